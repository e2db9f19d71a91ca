"""Control laws that differ from that of the bench: kept, learnt, or set aside, and never taken for physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.result import Result
from hil.identification.terms import Term
from hil.recording.recording import Recording

pytestmark = pytest.mark.net

OWNER = bench()
COGGING = Term("cogging_torque", 0, (0.2, 6.0, 0.4))
FILTER = Term("velocity_filter_lag", 0, (1e-3,))
_, _, VELOCITY_GAIN, _ = OWNER.known_control.gain_names


def laps(*terms: Term) -> Recording:
    return recorded(OWNER, *terms, times=4)


def answer(recording: Recording, owner: Bench) -> Result:
    return diagnose([recording], [], owner).result


def test_a_filter_of_the_velocity_is_not_taken_for_other_gains() -> None:
    result = answer(laps(FILTER), OWNER)
    assert [finding.effect for finding in result.missing] == ["velocity_filter_lag"]
    assert VELOCITY_GAIN not in result.parameter_corrections


def test_another_law_is_set_aside_and_said() -> None:
    """A command with a gain that changes with the speed follows no gains of the cascade."""
    recording = laps()
    bent = recording["torque_command_n_m"] * (1.0 + 0.5 * np.sin(3.0 * recording["time_s"]))
    result = answer(changed(recording, torque_command_n_m=bent), OWNER)
    assert result.verdict == "unexplained"
    assert result.location is not None
    assert result.location.block in ("controller", "drive", "motor_side")
    assert any("The control law of the bench was not used" in note for note in result.notes)


def test_a_motor_that_rests_away_from_its_set_points_is_judged_without_the_law() -> None:
    """The zeros of both differ here by 2 % of the travel; a loop that yields to a load looks the same."""
    recording = laps(COGGING)
    shifted = recording["position_command_m"] + 0.02 * np.ptp(recording["position_command_m"])
    result = answer(changed(recording, position_command_m=shifted), OWNER)
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert any("the motor rests 2 % of the travel behind its set-points" in note for note in result.notes)


def test_every_fourth_row_is_judged_without_the_law() -> None:
    recording = laps(COGGING)
    rows = {name: values[::4].copy() for name, values in recording.columns.items()}
    result = answer(replace(recording, columns=rows, period_s=4.0 * recording.period_s), OWNER)
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert any("ticks of the velocity loop" in note for note in result.notes)
