"""The control law of a bench is checked on the recording first: kept, learnt, or set aside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.bench.bench_file import Bench
from hil.bench.control_section import Control
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.result import Result
from hil.identification.law.fit import fit_law
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.recording.recording import Recording

OWNER = bench()
LAW = OWNER.known_control
COGGING = Term("cogging_torque", 0, (0.2, 6.0, 0.4))
FILTER = Term("velocity_filter_lag", 0, (1e-3,))
_, _, VELOCITY_GAIN, INTEGRAL_TIME = LAW.gain_names


def laps(*terms: Term) -> Recording:
    return recorded(OWNER, *terms, times=4)


def believed(**factors: float) -> Bench:
    values = {name: factor * getattr(LAW, name) for name, factor in factors.items()}
    return OWNER.model_copy(update={"control": LAW.model_copy(update=values)})


def answer(recording: Recording, owner: Bench) -> Result:
    return diagnose([recording], [], owner).result


WRONG = {"position_gain_1_s": 0.4, "velocity_feedforward": 1.7, VELOCITY_GAIN: 2.5, INTEGRAL_TIME: 0.5}


def test_gains_are_learnt_from_any_start() -> None:
    """The recording is one of the twin, whose law is `hil.control.cascade`; commands have the noise of rounding."""
    owner = believed(**WRONG)
    found = fit_law([take(laps(), owner)], owner)
    assert found.ratio < 1.0
    learnt = owner.known_control.with_gains(found.gains)
    for name in LAW.gain_names:
        assert getattr(learnt, name) == pytest.approx(getattr(LAW, name), rel=2e-3)


def test_wrong_gains_are_settings_of_the_controller_and_no_physics() -> None:
    result = answer(laps(), believed(**WRONG))
    assert result.verdict == "parameter_error"
    assert not result.missing
    assert {VELOCITY_GAIN, "position_gain_1_s"} <= set(result.parameter_corrections)
    assert result.parameter_corrections[VELOCITY_GAIN].value == pytest.approx(getattr(LAW, VELOCITY_GAIN), rel=2e-3)
    assert result.location is not None
    assert result.location.block == "controller"
    assert any("Check the controller's settings" in note for note in result.notes)


def test_a_cause_is_named_beside_wrong_gains() -> None:
    result = answer(laps(COGGING), believed(**WRONG))
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert VELOCITY_GAIN in result.parameter_corrections


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


def test_positions_coarser_than_those_of_the_loop_are_no_mismatch() -> None:
    recording = laps()
    step_rad = 100.0 * OWNER.motor_count
    coarse = np.round(recording["motor_position_rad"] / step_rad) * step_rad
    assert answer(changed(recording, motor_position_rad=coarse), OWNER).verdict == "no_mismatch"


def test_the_section_keeps_its_units() -> None:
    control = Control(
        position_gain_1_s=10.0, velocity_gain_ma_rpm=2.0, torque_constant_n_m_a=0.5, velocity_integral_time_ms=6.0
    )
    gains = control.gains(1e-3)
    halved = gains._replace(velocity_gain_n_m_s_rad=0.5 * gains.velocity_gain_n_m_s_rad)
    learnt = control.with_gains(halved)
    assert learnt.velocity_gain_ma_rpm == pytest.approx(1.0)
    assert learnt.velocity_integral_time_ms == pytest.approx(3.0)
    assert learnt.gains(1e-3) == pytest.approx(halved)
