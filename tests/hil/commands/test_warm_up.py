"""Compiling all kernels ahead, and saying so where it happens in the first command."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import hil

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


def test_kernels_of_the_loop_are_not_needed_to_explain(capsys: pytest.CaptureFixture[str]) -> None:
    """A diagnosis compiles those of the twin alone; whoever has all has those, too."""
    mark = provide_kernel_cache() / "compiled.txt"
    now = mark.read_text()
    mark.write_text("numba 0.1")
    try:
        compile_kernels(of_loop=False)
        capsys.readouterr()
        assert kernels_are_compiled(of_loop=False)
        assert not kernels_are_compiled()
    finally:
        mark.write_text(now)
    (mark.parent / "compiled-twin.txt").unlink()
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
