"""Each mechanism of drive and motor side has the property that an engineer would check."""

from math import e, pi

import numpy as np
import pytest
from contributions import AT_REST, PERIOD_S, REVOLUTION, along, call, moments, per_tick, phases
from hypothesis import assume, given
from hypothesis import strategies as st

torques = st.floats(-12.0, 12.0)
orders = st.integers(1, 48)


# -- drive


@given(
    commands=st.lists(torques, min_size=14, max_size=30),
    delay_s=st.floats(0.0, 0.012),
    steps=st.sampled_from([1, 5, 7, 50]),
)
def test_transport_delay_holds_and_shifts(commands, delay_s, steps) -> None:
    """A held command late by d: its mean over a period mixes two neighbours by the fraction of d."""
    periods = delay_s / PERIOD_S
    whole, fraction = int(periods), periods % 1.0
    past = np.concatenate((np.full(whole + 1, commands[0]), commands))
    expected = (1.0 - fraction) * past[1 : len(commands) + 1] + fraction * past[: len(commands)]
    np.testing.assert_allclose(per_tick("transport_delay", commands, steps, [delay_s]), expected, atol=1e-6)


@given(time_constant_s=st.floats(1e-5, 0.05), torque=torques, steps=st.sampled_from([1, 5, 50]))
def test_current_loop_lag_is_exact_at_any_step(time_constant_s, torque, steps) -> None:
    """A step of the command: mean over period k is u (1 - tau/T (e^{-kT/tau} - e^{-(k+1)T/tau}))."""
    answer = per_tick("current_loop_lag", [0.0] + [torque] * 40, steps, [time_constant_s])
    edges = np.exp(-np.arange(41) * PERIOD_S / time_constant_s)
    expected = torque * (1.0 + time_constant_s / PERIOD_S * np.diff(edges))
    np.testing.assert_allclose(answer[1:], expected, rtol=1e-9, atol=1e-9)


@given(value=torques, limit=st.floats(1e-3, 20.0))
def test_torque_saturation_clips(value, limit) -> None:
    assert call("torque_saturation", value, limit_n_m=limit) == np.clip(value, -limit, limit)


@given(value=torques, width=st.floats(0.0, 5.0))
def test_torque_dead_zone_offset_and_gate(value, width) -> None:
    offset, gate = (call("torque_dead_zone", value, variant=variant, half_width_n_m=width) for variant in (0, 2))
    assert offset == pytest.approx(np.sign(value) * max(abs(value) - width, 0.0))
    assert gate == (value if abs(value) > width else 0.0)
    for variant, same in ((1, offset), (3, gate)):
        assert call("torque_dead_zone", value, variant=variant, half_width_n_m=width) == same


@given(value=torques, fraction=st.floats(0.0, 0.5), order=orders, phase=phases)
def test_torque_ripple_is_a_share_of_the_torque(value, fraction, order, phase) -> None:
    ripple = along("torque_ripple", value, fraction=fraction, cycles_per_rev=order, phase_rad=phase)
    harmonic = np.fft.rfft(ripple) / REVOLUTION.size
    assert harmonic[0].real == pytest.approx(value, abs=1e-9)
    assert 2.0 * abs(harmonic[order]) == pytest.approx(abs(value) * fraction, abs=1e-9)


@given(value=torques, amplitude=st.floats(0.0, 2.0), order=orders, phase=phases)
def test_cogging_is_there_whatever_the_torque(value, amplitude, order, phase) -> None:
    cogging = along("cogging_torque", value, amplitude_n_m=amplitude, cycles_per_rev=order, phase_rad=phase) - value
    harmonic = np.fft.rfft(cogging) / REVOLUTION.size
    np.testing.assert_allclose(2.0 * harmonic[order], amplitude * np.exp(1j * (phase - pi / 2)), atol=1e-9)
    assert np.abs(np.delete(harmonic, order)).max() < 1e-9


@given(value=torques, coefficient=st.floats(1e-6, 1.0))
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


# -- motor side


@given(load=torques, at=moments)
def test_constant_load_is_held_by_the_same_motor_torque(load, at) -> None:
    assert call("constant_load", load, at, load_torque_n_m=load) == 0.0


@given(offset=st.floats(-1.0, 1.0), level=st.floats(1.0, 3.0), at=moments)
def test_asymmetric_friction_shifts_the_band(offset, level, at) -> None:
    shift = call("asymmetric_friction", 0.0, at, offset_torque_n_m=offset)
    forward, backward = shift + level, shift - level
    assert (forward + backward) / 2.0 == pytest.approx(offset)
    assert forward >= 0.0 >= backward  # still opposes both directions


@given(offset=st.floats(-1.0, 1.0), velocity=st.floats(0.0, 300.0))
def test_asymmetry_with_speed_is_the_same_torque_both_ways(offset, velocity) -> None:
    def torque(speed):
        return call("asymmetric_friction", 0.0, AT_REST._replace(velocity=speed), variant=1, offset_torque_n_m=offset)

    assert torque(AT_REST.viscous_speed) == pytest.approx(offset)
    assert torque(velocity) == pytest.approx(offset * velocity / AT_REST.viscous_speed)
    assert torque(-velocity) == torque(velocity)


@given(coulomb=st.floats(0.1, 5.0), static=st.floats(0.1, 8.0), stribeck=st.floats(0.01, 20.0))
def test_stribeck_falls_from_static_to_coulomb(coulomb, static, stribeck) -> None:
    def level(velocity):
        return call(
            "stribeck_friction",
            coulomb,
            AT_REST._replace(velocity=velocity),
            static_torque_n_m=static,
            stribeck_velocity_rad_s=stribeck,
        )

    assert level(0.0) == pytest.approx(static)
    assert level(stribeck) == pytest.approx(coulomb + (static - coulomb) / e)
    assert level(10.0 * stribeck) == pytest.approx(coulomb)
    assert level(-0.5 * stribeck) == level(0.5 * stribeck)


@given(level=st.floats(0.1, 5.0), slope=st.floats(-20.0, 20.0), position=st.floats(-0.5, 0.5))
def test_a_friction_gradient_is_straight_and_never_pushes(level, slope, position) -> None:
    at = AT_REST._replace(table_position_m=position)
    found = call("friction_gradient", level, at, slope_1_m=slope)
    assert found == pytest.approx(max(level * (1.0 + slope * position), 0.0), abs=1e-9)


@given(
    level=st.floats(0.1, 5.0), share=st.floats(0.0, 0.5), load=st.floats(-20.0, 20.0), speed=st.floats(-500.0, 500.0)
)
def test_load_dependent_friction_is_a_share_of_the_torque_that_is_carried(level, share, load, speed) -> None:
    """The torque is the load and the friction that it makes."""
    assume(speed != 0.0)
    friction = level + share * abs(load)
    torque = load + np.sign(speed) * friction
    found = call("load_dependent_friction", level, AT_REST._replace(torque=torque, velocity=speed), share=share)
    assert found == pytest.approx(friction, rel=1e-9, abs=1e-9)


@given(
    level=st.floats(0.1, 5.0),
    fraction=st.floats(-0.9, 5.0),
    start=st.floats(-0.3, 0.3),
    length=st.floats(0.02, 0.3),
    flank=st.floats(1e-3, 0.02),
    share=st.floats(-1.0, 1.0),
    effect=st.sampled_from(["local_friction", "local_torque_constant"]),
)
def test_a_zone_is_symmetric_and_acts_only_there(level, fraction, start, length, flank, share, effect) -> None:
    def at(position):
        moment = AT_REST._replace(table_position_m=position)
        values = {"fraction": fraction, "begin_m": start, "end_m": start + length, "flank_m": flank}
        return call(effect, level, moment, **values)

    middle = start + 0.5 * length
    for offset in (share * length, 0.0, 0.5 * length):
        assert at(middle + offset) == pytest.approx(at(middle - offset), rel=1e-6, abs=1e-6 * level)
        assert (
            min(level, (1.0 + fraction) * level) - 1e-9
            <= at(middle + offset)
            <= max(1.0, 1.0 + fraction) * level + 1e-9
        )
    assert at(middle) == pytest.approx((1.0 + fraction) * level)
    assert at(start) == pytest.approx((1.0 + 0.5 * fraction) * level)
    for outside in (start - 0.51 * flank, start + length + 0.51 * flank):
        assert at(outside) == pytest.approx(level)


@given(
    level=st.floats(0.1, 5.0),
    fraction=st.floats(0.0, 1.0),
    period=st.floats(1e-3, 1.0),
    phase=phases,
    position=st.floats(-0.5, 0.5),
)
def test_position_dependent_friction_repeats_and_never_pushes(level, fraction, period, phase, position) -> None:
    here, half, whole = (
        call(
            "position_dependent_friction",
            level,
            AT_REST._replace(table_position_m=position + shift * period),
            fraction=fraction,
            period_m=period,
            phase_rad=phase,
        )
        for shift in (0.0, 0.5, 1.0)
    )
    assert whole == pytest.approx(here, abs=1e-6)
    assert (here + half) / 2.0 == pytest.approx(level, abs=1e-6)
    assert here >= -1e-9


@given(stiffness=st.floats(1.0, 1e10), at=moments)
def test_presliding_gives_the_contact_its_stiffness(stiffness, at) -> None:
    assert call("presliding_hysteresis", 0.0, at, stiffness_n_m_rad=stiffness) == stiffness


@given(quadratic=st.floats(-1e-3, 1e-3), velocity=st.floats(-300.0, 300.0))
def test_quadratic_drag_quadruples_at_double_speed(quadratic, velocity) -> None:
    def drag(speed):
        return call(
            "nonlinear_viscous_friction", 0.0, AT_REST._replace(velocity=speed), quadratic_n_m_s2_rad2=quadratic
        )

    assert drag(2.0 * velocity) == pytest.approx(4.0 * drag(velocity))
    assert drag(-velocity) == -drag(velocity)
    assert drag(velocity) * velocity * quadratic >= 0.0  # q > 0 takes power, q < 0 gives some back


@given(quadratic=st.floats(0.0, 1e-3), velocity=st.floats(0.0, 300.0))
def test_drag_of_a_thinning_lubricant_rises_with_the_root_of_the_speed(quadratic, velocity) -> None:
    def drag(speed, variant=1):
        return call(
            "nonlinear_viscous_friction",
            0.0,
            AT_REST._replace(velocity=speed),
            variant=variant,
            quadratic_n_m_s2_rad2=quadratic,
        )

    assert drag(AT_REST.viscous_speed) == pytest.approx(drag(AT_REST.viscous_speed, variant=0))
    assert drag(4.0 * velocity) == pytest.approx(2.0 * drag(velocity))
    assert drag(-velocity) == -drag(velocity)
    quadratic = -quadratic
    assert drag(velocity) == 0.0  # no lubricant makes friction fall like that


@given(
    fraction=st.floats(-0.95, 5.0),
    tau=st.floats(1.0, 1e4),
    effect=st.sampled_from(["friction_drift", "torque_constant_drift"]),
)
def test_a_drift_starts_cold_and_settles(fraction, tau, effect) -> None:
    cold, at_tau, warm = (
        call(effect, 1.0, AT_REST._replace(time_s=multiple * tau), fraction=fraction, time_constant_s=tau)
        for multiple in (0.0, 1.0, 50.0)
    )
    assert cold == 1.0
    assert at_tau == pytest.approx(1.0 + fraction * (1.0 - 1.0 / e))
    assert warm == pytest.approx(1.0 + fraction)
