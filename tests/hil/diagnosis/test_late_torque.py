"""A torque that is recorded later than a row of its logger explains is named, and so is what the bench has already."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, renamed, write

from hil.diagnosis.diagnosis import Diagnosis
from hil.explanation import explain

WEIGHT_N_M = 0.2


def found(folder: Path, late_rows: int) -> Diagnosis:
    """The explanation of a motion in closed form that carries a weight, with its torque some rows late."""
    columns = axis(6000)
    columns["torque"] = np.roll(columns["torque"] + WEIGHT_N_M, late_rows)
    path = write(folder / "log.csv", renamed(columns, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    return explain([path], folder / "out").diagnosis


@pytest.mark.parametrize("late_rows", [4, pytest.param(0, marks=pytest.mark.long)])
def test_a_late_torque_is_named_beyond_what_a_row_may_do(tmp_path: Path, late_rows: int) -> None:
    diagnosis = found(tmp_path, late_rows)
    assert "The bench has already: A constant load of" in diagnosis.result.statement
    named = [one for one in diagnosis.result.missing if one.effect == "channel_time_skew"]
    assert len(named) == (1 if late_rows else 0)
    for one in named:
        # a position that is early is a torque that is late
        assert abs(one.parameters["delay_s"].value) == pytest.approx(late_rows * 1e-3, abs=0.2e-3)
