"""The control law from a recorded speed set-point, loop by loop, and delays of set-points and loop."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from diagnosis_runs import bench, changed
from servo_loop import one_encoder, servo_run

from hil.bench.bench_file import Bench
from hil.bench.control_section import Control
from hil.diagnosis.preparation.law_check import check_law
from hil.diagnosis.preparation.usable_law import LawCheck
from hil.identification.measured import take
from hil.recording.recording import Recording

OWNER = one_encoder(bench())
LAW = OWNER.known_control
POSITION_GAIN, FEEDFORWARD, VELOCITY_GAIN, INTEGRAL_TIME = LAW.gain_names
WRONG = {POSITION_GAIN: 0.4, FEEDFORWARD: 1.7, VELOCITY_GAIN: 2.5, INTEGRAL_TIME: 0.5}
SPEED = "velocity_reference_m_s"


@cache
def run(old_rows: float = 0.0, late_rows: int = 0, scale: float = 1.0, times: int = 1) -> Recording:
    return servo_run(OWNER, old_rows, late_rows, scale, times)


def believed(**factors: float) -> Bench:
    values = {name: factor * getattr(LAW, name) for name, factor in factors.items()}
    return OWNER.model_copy(update={"control": LAW.model_copy(update=values)})


def checked(recording: Recording, owner: Bench) -> LawCheck:
    return check_law([take(recording, owner)], owner)


def assert_gains(law: LawCheck, tolerance: float = 2e-3) -> None:
    """All four gains are corrected to the true ones."""
    for name in LAW.gain_names:
        assert law.corrections[name].value == pytest.approx(getattr(LAW, name), rel=tolerance)


def test_the_speed_set_point_of_a_known_law_changes_nothing() -> None:
    assert checked(run(scale=57.3), OWNER) == LawCheck(OWNER)


@pytest.mark.long
def test_a_velocity_loop_is_learnt_beside_an_unknown_position_loop() -> None:
    """The position loop adds what no set-point tells; the velocity loop follows its own input."""
    recording, owner = run(scale=3.0), believed(**WRONG)
    position = recording["position_command_m"]
    unrelated = position + 0.002 * np.sin(2.0 * np.pi * 1.3 * recording["time_s"])
    law = checked(changed(recording, position_command_m=unrelated), owner)
    assert law.mismatch
    assert not law.bench.law_known
    assert set(law.corrections) == {VELOCITY_GAIN, INTEGRAL_TIME}
    assert law.corrections[VELOCITY_GAIN].value == pytest.approx(getattr(LAW, VELOCITY_GAIN), rel=1e-3)
    assert "speed set-point" in law.advice


@pytest.mark.long
def test_another_speed_is_no_speed_set_point() -> None:
    """The chain of both loops is learnt where the column named so is not the output of the position loop."""
    recording = run()
    other = np.roll(recording[SPEED], 300)
    assert_gains(checked(changed(recording, velocity_reference_m_s=other), believed(**WRONG)))


@pytest.mark.parametrize(("late_rows", "by_loop"), [(7, True), pytest.param(-12, False, marks=pytest.mark.long)])
def test_a_delay_of_the_set_points_is_found_beside_wrong_gains(late_rows: int, by_loop: bool) -> None:
    recording = run(late_rows=late_rows) if by_loop else changed(run(late_rows=late_rows), velocity_reference_m_s=None)
    law = checked(recording, believed(**WRONG))
    assert_gains(law)
    delay = law.corrections["setpoint_delay_s"]
    assert delay.value == pytest.approx(1e-3 * late_rows, abs=2e-5)
    assert delay.std < 2e-5
    assert isinstance(law.bench.control, Control)
    assert law.bench.control.setpoint_delay_s == delay.value
    again = checked(recording, law.bench)
    assert not again.corrections


@pytest.mark.long
@pytest.mark.parametrize(("old_rows", "by_loop"), [(1.0, True), (0.5, False)])
def test_a_delay_of_the_loop_is_a_setting_and_sets_the_law_aside(old_rows: float, by_loop: bool) -> None:
    recording = run(old_rows) if by_loop else changed(run(old_rows), velocity_reference_m_s=None)
    law = checked(recording, believed(**WRONG))
    assert_gains(law)
    assert law.corrections["feedback_delay_s"].value == pytest.approx(1e-3 * old_rows, abs=2e-5)
    assert not law.bench.law_known
    assert not law.mismatch
