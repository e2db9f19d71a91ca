"""Each mechanism of drive, table and sensors has the property that an engineer would check."""

from math import pi

import numpy as np
import pytest
from contributions import AT_REST, PERIOD_S, PROPERTY, call, moments, per_tick
from hypothesis import assume, given
from hypothesis import strategies as st

from hil.twin.library import BY_ID

torques = st.floats(-12.0, 12.0)
phases = st.floats(-2.0 * pi, 2.0 * pi)
orders = st.integers(1, 48)
REVOLUTION = np.arange(144) * 2.0 * pi / 144  # even steps over one revolution


def along(effect, value, *, variant=0, angles=REVOLUTION, **parameters):
    """The contribution at each angle."""
    return np.array(
        [call(effect, value, AT_REST._replace(angle_rad=angle), variant=variant, **parameters) for angle in angles]
    )


# -- drive


@given(
    commands=st.lists(torques, min_size=14, max_size=30),
    delay_s=st.floats(0.0, 0.012),
    steps=st.sampled_from([1, 5, 7, 50]),
)
@PROPERTY
def test_transport_delay_holds_and_shifts(commands, delay_s, steps) -> None:
    """A held command late by d: its mean over a period mixes two neighbours by the fraction of d."""
    periods = delay_s / PERIOD_S
    whole, fraction = int(periods), periods % 1.0
    past = np.concatenate((np.full(whole + 1, commands[0]), commands))
    expected = (1.0 - fraction) * past[1 : len(commands) + 1] + fraction * past[: len(commands)]
    np.testing.assert_allclose(per_tick("transport_delay", commands, steps, [delay_s]), expected, atol=1e-6)


@given(time_constant_s=st.floats(1e-5, 0.05), torque=torques, steps=st.sampled_from([1, 5, 50]))
@PROPERTY
def test_current_loop_lag_is_exact_at_any_step(time_constant_s, torque, steps) -> None:
    """A step of the command: mean over period k is u (1 - tau/T (e^{-kT/tau} - e^{-(k+1)T/tau}))."""
    answer = per_tick("current_loop_lag", [0.0] + [torque] * 40, steps, [time_constant_s])
    edges = np.exp(-np.arange(41) * PERIOD_S / time_constant_s)
    expected = torque * (1.0 + time_constant_s / PERIOD_S * np.diff(edges))
    np.testing.assert_allclose(answer[1:], expected, rtol=1e-9, atol=1e-9)


@given(value=torques, limit=st.floats(1e-3, 20.0))
@PROPERTY
def test_torque_saturation_clips(value, limit) -> None:
    assert call("torque_saturation", value, limit_n_m=limit) == np.clip(value, -limit, limit)


@given(value=torques, width=st.floats(0.0, 5.0))
@PROPERTY
def test_torque_dead_zone_offset_and_gate(value, width) -> None:
    offset, gate = (call("torque_dead_zone", value, variant=variant, half_width_n_m=width) for variant in (0, 2))
    assert offset == pytest.approx(np.sign(value) * max(abs(value) - width, 0.0))
    assert gate == (value if abs(value) > width else 0.0)
    for variant, same in ((1, offset), (3, gate)):
        assert call("torque_dead_zone", value, variant=variant, half_width_n_m=width) == same


@given(value=torques, fraction=st.floats(0.0, 0.5), order=orders, phase=phases)
@PROPERTY
def test_torque_ripple_is_a_share_of_the_torque(value, fraction, order, phase) -> None:
    ripple = along("torque_ripple", value, fraction=fraction, cycles_per_rev=order, phase_rad=phase)
    harmonic = np.fft.rfft(ripple) / REVOLUTION.size
    assert harmonic[0].real == pytest.approx(value, abs=1e-9)
    assert 2.0 * abs(harmonic[order]) == pytest.approx(abs(value) * fraction, abs=1e-9)


@given(value=torques, amplitude=st.floats(0.0, 2.0), order=orders, phase=phases)
@PROPERTY
def test_cogging_is_there_whatever_the_torque(value, amplitude, order, phase) -> None:
    cogging = along("cogging_torque", value, amplitude_n_m=amplitude, cycles_per_rev=order, phase_rad=phase) - value
    harmonic = np.fft.rfft(cogging) / REVOLUTION.size
    np.testing.assert_allclose(2.0 * harmonic[order], amplitude * np.exp(1j * (phase - pi / 2)), atol=1e-9)
    assert np.abs(np.delete(harmonic, order)).max() < 1e-9


@given(value=torques, coefficient=st.floats(1e-6, 1.0))
@PROPERTY
def test_torque_constant_falls_with_the_square_of_the_current(value, coefficient) -> None:
    torque = call("torque_constant_saturation", value, coefficient_1_n2_m2=coefficient)
    assert torque == -call("torque_constant_saturation", -value, coefficient_1_n2_m2=coefficient)
    assert torque * value >= 0.0  # never turns round
    more = call("torque_constant_saturation", 1.1 * value, coefficient_1_n2_m2=coefficient)
    assert abs(more) >= abs(torque) * (1.0 - 1e-12)  # more current never gives less
    assume(3.0 * coefficient * value**2 < 1.0)
    assert value - torque == pytest.approx(coefficient * value**3, abs=1e-12)


def test_velocity_filter_names_its_time_constant() -> None:
    assert call("velocity_filter_lag", 0.0, time_constant_s=2e-3) == 2e-3


# -- table


@given(share=st.floats(0.0, 1.0), at=moments)
@PROPERTY
def test_table_side_friction_is_a_share(share, at) -> None:
    assert call("table_side_friction", 0.0, at, share=share) == share


@given(
    force=st.floats(-1e3, 1e3),
    start=st.floats(0.0, 0.02),
    length=st.floats(0.0, 0.02),
    step_s=st.sampled_from([1e-3, 2e-4, 3e-5]),
)
@PROPERTY
def test_external_force_has_the_impulse_of_its_window(force, start, length, step_s) -> None:
    pushes = [
        call(
            "external_force",
            0.0,
            AT_REST._replace(time_s=k * step_s, step_s=step_s),
            force_n=force,
            start_s=start,
            end_s=start + length,
        )
        for k in range(int(0.045 / step_s))
    ]
    assert np.sum(pushes) * step_s == pytest.approx(force * length, abs=1e-9)
    assert np.abs(pushes).max() <= abs(force) * (1.0 + 1e-12)


@given(stiffness=st.floats(0.0, 1e5), rest=st.floats(-1.0, 1.0), offset=st.floats(-1.0, 1.0))
@PROPERTY
def test_spring_load_pulls_to_rest(stiffness, rest, offset) -> None:
    force = call(
        "spring_load",
        0.0,
        AT_REST._replace(table_position_m=rest + offset),
        stiffness_n_m=stiffness,
        rest_position_m=rest,
    )
    assert force == pytest.approx(-stiffness * offset, abs=1e-6)


# -- sensors


@given(amplitude=st.floats(0.0, 0.01), phase=phases, value=st.floats(-100.0, 100.0))
@PROPERTY
def test_encoder_eccentricity_once_per_revolution(amplitude, phase, value) -> None:
    error = along("encoder_eccentricity", value, amplitude_rad=amplitude, phase_rad=phase) - value
    harmonic = np.fft.rfft(error) / REVOLUTION.size
    np.testing.assert_allclose(2.0 * harmonic[1], amplitude * np.exp(1j * (phase - pi / 2)), atol=1e-11)
    assert np.abs(np.delete(harmonic, 1)).max() < 1e-11


@given(amplitude=st.floats(0.0, 1e-5), period=st.floats(1e-5, 1e-3), phase=phases, position=st.floats(-0.5, 0.5))
@PROPERTY
def test_scale_interpolation_error_within_its_signal_period(amplitude, period, phase, position) -> None:
    quarters = [
        call(
            "scale_interpolation_error",
            x,
            AT_REST._replace(table_position_m=x),
            amplitude_m=amplitude,
            period_m=period,
            phase_rad=phase,
        )
        - x
        for x in position + period * np.arange(5) / 4.0
    ]
    assert np.hypot(quarters[0], quarters[1]) == pytest.approx(amplitude, abs=1e-12)
    np.testing.assert_allclose(
        [quarters[2], quarters[3], quarters[4]], [-quarters[0], -quarters[1], quarters[0]], atol=1e-12
    )


@given(delay_s=st.floats(-0.01, 0.01), variant=st.integers(0, 2))
@PROPERTY
def test_channel_time_skew_delays_the_one_channel(delay_s, variant) -> None:
    """A parabola is delayed exactly, the mean torque of a period as that of a command held over it; what precedes and
    follows the record is held."""
    time_s = np.arange(100) * PERIOD_S
    channels = tuple(factor * (1.0 + time_s - 3.0 * time_s**2) for factor in (1.0, 2.0, 3.0, 4.0))
    skewed = BY_ID["channel_time_skew"].variants[variant].contribution(channels, (delay_s,), PERIOD_S)
    late = {"table_position": 1, "torque": 3, "motor_position": 0}[BY_ID["channel_time_skew"].forms[variant]]
    for index, (before, after) in enumerate(zip(channels, skewed, strict=True)):
        assert after.shape == before.shape
        if index != late:
            np.testing.assert_array_equal(after, before)
    moment = time_s - delay_s
    exact = (late + 1.0) * (1.0 + moment - 3.0 * moment**2)
    if late == 3:
        fine = np.repeat(channels[late], 1000)
        whole = round(delay_s / PERIOD_S * 1000)
        exact = np.roll(fine, whole).reshape(-1, 1000).mean(axis=1)
        np.testing.assert_allclose(skewed[late][12:-12], exact[12:-12], atol=4e-5)
        return
    np.testing.assert_allclose(skewed[late][12:-12], exact[12:-12], rtol=1e-12)
    if delay_s > 2.0 * PERIOD_S:
        assert skewed[late][0] == pytest.approx(channels[late][0])
    if delay_s < -2.0 * PERIOD_S:
        assert skewed[late][-1] == pytest.approx(channels[late][-1])
