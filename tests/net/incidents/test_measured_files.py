"""Measured recordings whose columns have no names are told by what they hold."""

from __future__ import annotations

from pathlib import Path

import pytest
from measured_recordings import shared

from hil.importing.draft_map import draft_map

pytestmark = pytest.mark.net


@pytest.mark.parametrize(
    ("folder", "expected"),
    [
        (
            "kuka/axis1_a.csv",
            {"motor_position_rad": "c", "table_position_m": "d", "position_command_m": "b", "torque_n_m": "g"},
        ),
        (
            "rig/null/train_1.csv",
            {"motor_position_rad": "d", "table_position_m": "e", "position_command_m": "b", "torque_n_m": "f"},
        ),
    ],
)
def test_measured_recordings_are_told_without_names(tmp_path: Path, folder: str, expected: dict[str, str]) -> None:
    lines = shared(folder).read_text().splitlines()
    letters = ",".join("abcdefgh"[: len(lines[0].split(","))])
    path = tmp_path / "log.csv"
    path.write_text("\n".join([letters, *lines[1:]]) + "\n")
    assert {one.channel: one.entry["column"] for one in draft_map(path).channels} == expected
