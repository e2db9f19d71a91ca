"""The wheel: what it holds, and that it works in an environment of its own outside the repository."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = ("hil", "drivers", "profiles", "docs", "pyproject.toml", "README.md", "LICENSE")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of a copy of the sources, built without a network by the setuptools of this environment."""
    place = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, place / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, place)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = [
        "wheel",
        "--no-index",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        str(place / "built"),
        str(place),
    ]
    subprocess.run([*pip, *build], check=True, cwd=place, timeout=120)
    (built,) = (place / "built").iterdir()
    return built


def test_the_wheel_holds_all_files_of_the_packages_and_nothing_else(wheel: Path) -> None:
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert {name.split("/")[0] for name in names} == {"hil", "drivers"}
    wanted = {
        str(path.relative_to(ROOT))
        for package in ("hil", "hil/profiles", "hil/manual/guide", "drivers")  # links are not followed
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert sorted(wanted - names) == []
    assert sorted(names - wanted) == []
    kinds = ("hil/profiles/jog.yaml", "hil/benches/reference.yaml", "hil/maps/emps.yaml", "drivers/eds/servo_drive.eds")
    kinds += ("hil/manual/guide/start.md", "hil/motion/profile.schema.json", "hil/report/page.html.j2")
    kinds += ("hil/scope/static/index.html", "hil/py.typed", "drivers/py.typed", "hil/units/hil-bench@.service")
    assert set(kinds) <= names
    assert wheel.stat().st_size < 2_000_000


@pytest.mark.long
def test_an_installed_wheel_runs_outside_the_repository(wheel: Path, tmp_path: Path) -> None:
    """Base install from the package index: a run by short names, the guide, and a demo that says how to get pages."""

    def run(*command: str | Path) -> str:
        environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
        ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=900)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    subprocess.run([sys.executable, "-m", "venv", tmp_path / "clean"], check=True)
    programs = tmp_path / "clean" / "bin"
    subprocess.run([programs / "python", "-m", "pip", "install", "--quiet", wheel], check=True)
    assert "Start in five minutes" in run(programs / "hil", "guide", "start")
    run(programs / "hil", "run", "reference", "--bench", "reference", "--virtual", "--out", "first")
    assert (tmp_path / "first" / "reference.parquet").is_file()
    told = run(programs / "hil", "demo", "--virtual", "--seed", "1", "--effect", "backlash", "--out", "demo")
    assert "It found what was concealed." in told
    assert "pip install 'hil-servo[report]'" in told
    assert (tmp_path / "demo" / "diagnosis.json").is_file()
