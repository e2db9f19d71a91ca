"""A file with channels of several sampling rates is read at the rate of motion and torque."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, write

from hil.commands.import_ import import_
from hil.errors import InputError
from hil.importing.draft_map import draft_map
from hil.importing.slow_columns import rows_per_value
from hil.recording.recording import Recording, read_recording

COLUMNS = axis()
NAMES = {"t": "time_s", "x_set": "position_setpoint_mm", "angle": "motor_angle_rad", "torque": "torque_Nm"}


def every(rows: int, values: np.ndarray, first: int = 0) -> np.ndarray:
    """The column with a value in one row of several."""
    kept = (np.arange(values.size) - first) % rows == 0
    return np.where(kept, values, np.nan)


def imported(folder: Path, **changed: np.ndarray) -> tuple[list[str], Recording]:
    path = write(folder / "log.csv", {NAMES[key]: changed.get(key, COLUMNS[key]) for key in NAMES if key != "x_set"})
    if "x_set" in changed:
        path = write(folder / "log.csv", {NAMES[key]: changed.get(key, COLUMNS[key]) for key in NAMES})
    notes = draft_map(path).unsure
    import_(path, None, folder / "out.parquet", None, None)
    return notes, read_recording(folder / "out.parquet")


@pytest.mark.parametrize("key", ["torque", "angle"])
def test_of_motion_and_torque_the_slower_one_gives_the_rate(tmp_path: Path, key: str) -> None:
    notes, recording = imported(tmp_path, **{key: every(4, COLUMNS[key])})
    assert f"rates: {NAMES[key]}: slower than the rows; 1000 of 4000 rows" in "".join(notes)
    assert recording.period_s == pytest.approx(4e-3)
    np.testing.assert_allclose(recording["torque_n_m"], COLUMNS["torque"][::4], atol=1e-3)


def test_a_slower_set_point_is_left_out(tmp_path: Path) -> None:
    notes, recording = imported(tmp_path, x_set=every(10, COLUMNS["x_set"]))
    assert any("a number in one row of 10 only" in note for note in notes)
    assert len(recording) == COLUMNS["t"].size
    assert "position_command_m" not in recording.columns


def test_a_set_point_as_slow_as_the_motion_is_kept(tmp_path: Path) -> None:
    _, recording = imported(tmp_path, x_set=every(2, COLUMNS["x_set"]), angle=every(2, COLUMNS["angle"]))
    assert recording.period_s == pytest.approx(2e-3)
    assert "position_command_m" in recording.columns


def test_values_in_different_rows_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not in the same rows"):
        imported(tmp_path, angle=every(4, COLUMNS["angle"]), torque=every(4, COLUMNS["torque"], first=2))


def test_a_rate_is_told_beside_a_lost_value_and_not_of_a_part() -> None:
    slow = every(4, COLUMNS["torque"])
    assert rows_per_value(slow) == 4.0
    slow[400] = np.nan
    assert rows_per_value(slow) == 4.0
    slow[slow.size // 2 :] = np.nan
    assert rows_per_value(slow) is None
    assert rows_per_value(COLUMNS["torque"]) is None
