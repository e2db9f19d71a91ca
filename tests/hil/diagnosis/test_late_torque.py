"""A torque that is recorded late is in the drafted bench, as a weight is: neither is a mismatch."""

from __future__ import annotations

import re
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
def test_a_late_torque_is_in_the_bench_and_no_mismatch(tmp_path: Path, late_rows: int) -> None:
    diagnosis = found(tmp_path, late_rows)
    late = "The torque is recorded 3.99 ms after it acts. " if late_rows else ""
    already = rf"The bench file has already(, here refitted)?: {late}A constant load of"
    assert re.search(already, diagnosis.result.statement)
    assert not [one for one in diagnosis.result.missing if one.effect == "channel_time_skew"]
    delay_s = diagnosis.given_bench.torque_delay_s
    assert (delay_s or 0.0) == pytest.approx(-(late_rows + 0.5) * 1e-3 if late_rows else 0.0, abs=0.6e-3)
    if late_rows:  # the twin of the bench holds the motion, and leaves no torque
        assert delay_s == pytest.approx(-(late_rows + 0.5) * 1e-3, abs=0.2e-3)
        assert diagnosis.result.torque_left is not None
        assert diagnosis.result.torque_left.final == pytest.approx(diagnosis.result.torque_left.plain, abs=0.005)
