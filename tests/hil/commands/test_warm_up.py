"""Compiling all kernels ahead, and saying so where it happens in the first command."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import hil
from own_recordings import CLEAN

from hil.commands import warm_up
from hil.commands.warm_up import compile_kernels, kernels_are_compiled
from hil.compiled.kernel_cache import provide_kernel_cache

SAID = "compiling kernels, once after the installation: about a minute ..."
ROOT = Path(__file__).parents[3]
PROFILE = ROOT / "profiles" / "identification.yaml"


def test_compiled_kernels_are_not_spoken_of(tmp_path: Path) -> None:
    folder = provide_kernel_cache()
    ran = hil(tmp_path, "warm-up")
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, f"All kernels are compiled in {folder}\n", "")


def test_another_numba_python_or_processor_compiles_again(capsys: pytest.CaptureFixture[str]) -> None:
    mark = provide_kernel_cache() / "compiled.txt"
    now = mark.read_text()
    mark.write_text("numba 0.1")
    compile_kernels()
    assert capsys.readouterr().err.splitlines() == [SAID]
    assert mark.read_text() == now
    compile_kernels()
    assert capsys.readouterr().err == ""


def test_kernels_of_the_loop_are_not_needed_to_explain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A diagnosis asks for those of the twin alone; a loop then for the others; whoever has all has those, too."""
    monkeypatch.setattr(warm_up, "_mark", tmp_path.joinpath)
    compile_kernels(of_loop=False)
    assert capsys.readouterr().err.splitlines() == [SAID.replace("about", "half")]
    assert (kernels_are_compiled(of_loop=False), kernels_are_compiled()) == (True, False)
    compile_kernels()
    assert capsys.readouterr().err.splitlines() == [SAID]
    (tmp_path / "compiled-twin.txt").unlink()
    assert kernels_are_compiled(of_loop=False)


@pytest.mark.long
def test_nothing_is_left_to_compile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty cache: warm-up fills it, and no command adds a kernel."""
    for package in ("hil", "drivers"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))

    def command(*arguments: str) -> subprocess.CompletedProcess[str]:
        ran = subprocess.run(
            [sys.executable, "-m", "hil.cli", *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        # a busy machine stops a run in wall-clock time
        assert ran.returncode == 0 or "loop too late" in ran.stderr, ran.stderr
        return ran

    def kernels() -> set[Path]:
        return set((tmp_path / "kernels").rglob("*.nbc"))

    first = command("warm-up")
    assert first.stderr.splitlines() == [SAID]
    assert f"compiled in {tmp_path / 'kernels'}{os.sep}hil-kernels-" in first.stdout
    compiled = kernels()
    assert len(compiled) > 10
    for arguments in (
        ("run", str(PROFILE), "--out", "wall", "--force"),
        ("run", str(PROFILE), "--virtual", "--out", "virtual"),
        ("compare", f"virtual/{PROFILE.stem}.parquet", "--fit", "--out", "compared"),
        ("diagnose", f"virtual/{PROFILE.stem}.parquet", "--out", "diagnosed"),
        ("paper", "--out", "paper"),
    ):
        assert SAID not in command(*arguments).stderr
        assert {path.name for path in kernels() - compiled} == set(), arguments[0]


@pytest.mark.long
def test_a_diagnosis_adds_none_to_the_kernels_of_the_twin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("hil", "drivers"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    code = "from hil.commands.warm_up import compile_kernels; compile_kernels(of_loop=False)"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    compiled = {path.name for path in (tmp_path / "kernels").rglob("*.nbc")}
    for command in (("explain", str(CLEAN), "--out", "explained"), ("identify", str(CLEAN), "--out", "bench.yaml")):
        subprocess.run([sys.executable, "-m", "hil.cli", *command], cwd=tmp_path, check=True, capture_output=True)
        assert {path.name for path in (tmp_path / "kernels").rglob("*.nbc")} == compiled, command
