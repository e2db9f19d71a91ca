"""The control section of a drafted bench: gains and delays of a simulated loop, from set-points and torque."""

from __future__ import annotations

import math

import pytest
from diagnosis_runs import bench, changed
from servo_loop import one_encoder, servo_run
from table_loop import (
    INTEGRAL_TIME_S,
    LEAD_M,
    PERIOD_S,
    POSITION_GAIN_1_S,
    TICKS,
    VELOCITY_GAIN_N_M_S_RAD,
    table_run,
)

from hil.bench.bench_file import Bench
from hil.drafting.loop_values import ControlValues, loop_values
from hil.recording.recording import Recording

OWNER = one_encoder(bench())
RATIO_M_RAD = OWNER.axis.ratio_m_rad


def assert_drafted(
    drafted: ControlValues, velocity_setpoint: str = "recorded", owner: Bench = OWNER, **more: float
) -> None:
    values = {entry.key: entry.value for entry in drafted.values}
    gains = owner.gains
    expected = {
        "position_gain_1_s": gains.position_gain_1_s,
        "velocity_feedforward": gains.velocity_feedforward,
        "velocity_gain_n_m_s_rad": gains.velocity_gain_n_m_s_rad,
        "velocity_integral_time_s": gains.velocity_gain_n_m_s_rad / gains.integral_gain_n_m_rad,
        "position_period_s": gains.position_ticks * gains.period_s,
        "velocity_period_s": gains.period_s,
        **more,
    }
    assert values.pop("velocity_estimate") == "backward_difference"
    assert values.pop("velocity_setpoint", "recorded") == velocity_setpoint
    assert values == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("scale", [None, 57.3, pytest.param(1.0, marks=pytest.mark.long)])
def test_gains_are_drafted_with_and_without_a_speed_set_point(scale: float | None) -> None:
    recording = servo_run(OWNER, scale=scale or 1.0)
    recording = recording if scale else changed(recording, velocity_reference_m_s=None)
    assert_drafted(loop_values(recording, RATIO_M_RAD))


@pytest.mark.long
def test_a_delay_of_the_set_points_is_drafted() -> None:
    drafted = loop_values(servo_run(OWNER, late_rows=7), RATIO_M_RAD)
    assert_drafted(drafted, setpoint_delay_s=7e-3)


def test_a_feed_forward_of_the_last_difference_of_the_set_points_is_drafted() -> None:
    recording = changed(servo_run(OWNER, differenced=True), velocity_reference_m_s=None)
    drafted = loop_values(recording, RATIO_M_RAD)
    assert_drafted(drafted, velocity_setpoint="backward_difference")


@pytest.mark.long
def test_a_filter_of_the_velocity_is_drafted() -> None:
    """A drive whose loops run at one rate, with a filter of four periods."""
    control = OWNER.known_control.model_copy(
        update={"position_period_s": 1e-3, "velocity_filter_time_constant_s": 4e-3, "velocity_integral_time_ms": 50.0}
    )
    owner = OWNER.model_copy(update={"control": control})
    drafted = loop_values(changed(servo_run(owner), velocity_reference_m_s=None), RATIO_M_RAD)
    assert_drafted(drafted, owner=owner, velocity_filter_time_constant_s=4e-3)


def test_a_delay_of_the_loop_is_said_and_the_law_left_unknown() -> None:
    drafted = loop_values(servo_run(OWNER, old_rows=1.0), RATIO_M_RAD)
    assert not drafted.values
    assert "1 ms old" in drafted.why


def test_the_measured_torque_stands_for_its_command() -> None:
    """A drive that closes the velocity loop itself reports no command; the current is noisy."""
    recording: Recording = changed(servo_run(OWNER), torque_command_n_m=None)
    values = {entry.key: entry.value for entry in loop_values(recording, RATIO_M_RAD).values}
    assert values["velocity_gain_n_m_s_rad"] == pytest.approx(OWNER.gains.velocity_gain_n_m_s_rad, rel=0.01)


@pytest.mark.parametrize("time_s", [0.02, pytest.param(0.2, marks=pytest.mark.long)])
@pytest.mark.parametrize("feedforward", [1.0, 0.4])
def test_loops_of_one_period_are_told_apart(time_s: float, feedforward: float) -> None:
    """The position error is the integral of set less measured speed there, so the closed form has one column less."""
    gain = 1.0 / (2.0 * max(time_s, 0.05))
    changes = {
        "position_period_s": OWNER.period_s,
        "velocity_integral_time_s": time_s,
        "velocity_integral_time_ms": None,
        "velocity_feedforward": feedforward,
        "position_gain_1_s": gain,
    }
    owner = OWNER.model_copy(update={"control": OWNER.known_control.model_copy(update=changes)})
    recording = changed(servo_run(owner), velocity_reference_m_s=None, torque_command_n_m=None)
    values = {entry.key: entry.value for entry in loop_values(recording, RATIO_M_RAD).values}
    assert values["position_gain_1_s"] == pytest.approx(gain, rel=0.05)
    assert values["velocity_gain_n_m_s_rad"] == pytest.approx(OWNER.gains.velocity_gain_n_m_s_rad, rel=0.02)
    assert values["velocity_integral_time_s"] == pytest.approx(time_s, rel=0.05)
    assert values["velocity_feedforward"] == pytest.approx(feedforward, abs=0.02)
    assert values["position_period_s"] == OWNER.period_s


OF_TABLE = {
    "position_gain_1_s": POSITION_GAIN_1_S,
    "velocity_feedforward": 1.0,
    "velocity_gain_n_m_s_rad": VELOCITY_GAIN_N_M_S_RAD,
    "velocity_integral_time_s": INTEGRAL_TIME_S,
    "position_period_s": TICKS * PERIOD_S,
}


@pytest.mark.long
@pytest.mark.parametrize(
    ("on_motor", "torque_only"),
    [(False, False), (True, False), pytest.param(False, True, marks=pytest.mark.long)],
)
def test_the_encoder_of_the_position_loop_is_told(on_motor: bool, torque_only: bool) -> None:
    recording = table_run(on_motor=on_motor)
    recording = changed(recording, torque_command_n_m=None) if torque_only else recording
    feedback, *values = loop_values(recording, LEAD_M / (2.0 * math.pi)).values
    assert (feedback.key, feedback.value) == ("position_feedback", "motor" if on_motor else "table")
    assert feedback.error == "told"
    drafted = {entry.key: entry.value for entry in values}
    assert {key: drafted[key] for key in OF_TABLE} == pytest.approx(OF_TABLE, rel=5e-3)


@pytest.mark.long
def test_on_a_rigid_axis_the_encoder_of_the_position_loop_is_not_told() -> None:
    """The motor stands for it, and the draft says so."""
    rigid = changed(table_run(guideway_n=0.0, stiffness_n_m=2.5e10, noise_n_m=0.02), torque_command_n_m=None)
    values = loop_values(rigid, LEAD_M / (2.0 * math.pi)).values
    assert (values[0].value, values[0].error) == ("motor", "not told, assumed")
    assert values[1].value == pytest.approx(POSITION_GAIN_1_S, rel=0.01)
