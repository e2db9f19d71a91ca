"""The unit files are sound, as systemd itself sees it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

UNITS = sorted((Path(__file__).parent.parent / "systemd").glob("hil.*"))


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze of systemd")
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_unit_is_sound(unit: Path) -> None:
    found = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(unit)], capture_output=True, text=True, check=False
    )
    assert found.stdout + found.stderr == ""  # it returns 0 for a bad unit


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze of systemd")
def test_a_bad_unit_would_be_noticed(tmp_path: Path) -> None:
    bad = tmp_path / "hil.service"
    bad.write_text(UNITS[0].read_text().replace("KillSignal=SIGINT", "KillSignal=NOTHING"))
    found = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(bad)], capture_output=True, text=True, check=False
    )
    assert "NOTHING" in found.stdout + found.stderr


def test_there_are_units() -> None:
    assert [unit.name for unit in UNITS] == ["hil.service", "hil.timer"]
