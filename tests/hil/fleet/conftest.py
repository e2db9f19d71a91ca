"""A small fleet of simulated axes, recorded once: good recordings, and beside them bad ones."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from ageing_fleet import WAYS, make_fleet

RECORDINGS, AXES = 4, 2
BAD = "*_2300.parquet"


@pytest.fixture(scope="session")
def with_bad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Each axis has one of each: truncated, empty, of another axis, of another sampling."""
    folder = tmp_path_factory.mktemp("recorded") / "fleet"
    make_fleet(folder, AXES, RECORDINGS, seconds=3.0, bad=len(WAYS) / RECORDINGS)
    return folder


@pytest.fixture
def fleet(with_bad: Path, tmp_path: Path) -> Path:
    """A copy without the bad ones."""
    return Path(shutil.copytree(with_bad, tmp_path / "fleet", ignore=shutil.ignore_patterns(BAD)))


@pytest.fixture(autouse=True)
def threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker takes one thread, by the environment of its process; here that of the tests stays as it was."""
    monkeypatch.setenv("HIL_THREADS", "1")
