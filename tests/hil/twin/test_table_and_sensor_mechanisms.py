"""Each mechanism of table and sensors has the property that an engineer would check."""

from math import pi

import numpy as np
import pytest
from contributions import AT_REST, PERIOD_S, REVOLUTION, along, call, moments, phases
from hypothesis import given
from hypothesis import strategies as st

from hil.twin.library import BY_ID

# -- table


@given(share=st.floats(0.0, 1.0), at=moments)
def test_table_side_friction_is_a_share(share, at) -> None:
    assert call("table_side_friction", 0.0, at, share=share) == share


@given(share=st.floats(-1.0, 1.0), coulomb=st.floats(0.0, 1.0), at=moments)
def test_viscous_friction_has_less_on_one_side(share, coulomb, at) -> None:
    found = call("table_side_viscous_friction", coulomb, at, share=share)
    assert -1e-15 <= found <= 1.0 + 1e-15
    rest, before = (1.0 - found, 1.0 - coulomb) if share > 0.0 else (found, coulomb)
    assert rest == pytest.approx((1.0 - abs(share)) * before, abs=1e-15)


@given(
    force=st.floats(-1e3, 1e3),
    start=st.floats(0.0, 0.02),
    length=st.floats(0.0, 0.02),
    step_s=st.sampled_from([1e-3, 2e-4, 3e-5]),
)
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
def test_spring_load_pulls_to_rest(stiffness, rest, offset) -> None:
    force = call(
        "spring_load",
        0.0,
        AT_REST._replace(table_position_m=rest + offset),
        stiffness_n_m=stiffness,
        rest_position_m=rest,
    )
    assert force == pytest.approx(-stiffness * offset, abs=1e-6)


@given(stiffness=st.floats(0.0, 1e5), edge=st.floats(-1.0, 1.0), offset=st.floats(0.0, 1.0))
def test_an_end_stop_only_pushes_back(stiffness, edge, offset) -> None:
    def force(position, variant):
        at = AT_REST._replace(table_position_m=position)
        return call("end_stop", 0.0, at, variant=variant, stiffness_n_m=stiffness, edge_m=edge)

    assert force(edge + offset, 0) == pytest.approx(-stiffness * offset, abs=1e-6)
    assert force(edge - offset, 1) == pytest.approx(stiffness * offset, abs=1e-6)
    assert force(edge - offset, 0) == force(edge + offset, 1) == 0.0


@given(
    torque=st.floats(0.0, 1e3),
    angle=st.floats(-3.0, 3.0),
    from_down=st.floats(-3.0, 3.0),
)
def test_gravity_pulls_an_arm_down(torque, angle, from_down) -> None:
    def weight(seen_from_down):
        at = AT_REST._replace(table_position_m=seen_from_down - angle)
        return call("gravity_torque", 0.0, at, gravity_torque_n_m=torque, angle_rad=angle)

    assert weight(0.0) == pytest.approx(0.0, abs=1e-9)
    assert weight(np.pi / 2) == pytest.approx(-torque, abs=1e-9)
    assert weight(np.pi / 6) == pytest.approx(-0.5 * torque, abs=1e-9)
    assert weight(from_down) == pytest.approx(-weight(-from_down), abs=1e-9)


@given(force=st.floats(0.0, 500.0), frequency_hz=st.floats(0.5, 50.0), phase=phases, position=st.floats(-1.0, 1.0))
def test_periodic_force_goes_with_the_clock_and_not_with_the_position(force, frequency_hz, phase, position) -> None:
    def at(turns):
        moment = AT_REST._replace(time_s=turns / frequency_hz, step_s=0.0, table_position_m=position)
        return call("periodic_force", 0.0, moment, force_n=force, frequency_hz=frequency_hz, phase_rad=phase)

    assert np.hypot(at(0.1), at(0.35)) == pytest.approx(force, rel=1e-9, abs=1e-9)
    assert at(1.1) == pytest.approx(at(0.1), abs=1e-6)
    assert at(0.0) == pytest.approx(force * np.sin(phase), abs=1e-6)


# -- sensors


@given(amplitude=st.floats(0.0, 0.01), phase=phases, value=st.floats(-100.0, 100.0))
def test_encoder_eccentricity_once_per_revolution(amplitude, phase, value) -> None:
    error = along("encoder_eccentricity", value, amplitude_rad=amplitude, phase_rad=phase) - value
    harmonic = np.fft.rfft(error) / REVOLUTION.size
    np.testing.assert_allclose(2.0 * harmonic[1], amplitude * np.exp(1j * (phase - pi / 2)), atol=1e-11)
    assert np.abs(np.delete(harmonic, 1)).max() < 1e-11


@given(amplitude=st.floats(0.0, 0.01), phase=phases, value=st.floats(-100.0, 100.0), ratio=st.floats(0.01, 1.0))
def test_load_encoder_eccentricity_once_per_revolution_of_the_load(amplitude, phase, value, ratio) -> None:
    def error(load_rad):
        at = AT_REST._replace(table_position_m=load_rad, angle_rad=load_rad / ratio)
        return call("load_encoder_eccentricity", value, at, amplitude_rad=amplitude, phase_rad=phase) - value

    assert error(-phase) == pytest.approx(0.0, abs=1e-12)
    assert error(np.pi / 2 - phase) == pytest.approx(amplitude, abs=1e-12)
    assert error(np.pi / 6 - phase) == pytest.approx(0.5 * amplitude, abs=1e-12)
    assert error(2.0 * np.pi + 0.4) == pytest.approx(error(0.4), abs=1e-12)


@given(amplitude=st.floats(0.0, 1e-5), period=st.floats(1e-5, 1e-3), phase=phases, position=st.floats(-0.5, 0.5))
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
def test_channel_time_skew_delays_the_one_channel(delay_s, variant) -> None:
    """A smooth motion is delayed, the mean torque of a period as that of a command held over it."""
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
    np.testing.assert_allclose(skewed[late][12:-12], exact[12:-12], atol=2e-7)


@given(periods=st.integers(1, 20), seed=st.integers(0, 99))
def test_a_delayed_channel_is_continued_by_point_reflection_and_keeps_its_noise(periods, seed) -> None:
    """Interpolation at half a row would halve the energy of white noise, which a fit takes for evidence."""
    late = BY_ID["channel_time_skew"].variants[2].contribution
    motion = np.random.default_rng(seed).normal(size=2001)
    channels = (motion, *np.zeros((3, motion.size)))
    whole = late(channels, (periods * PERIOD_S,), PERIOD_S)[0]
    np.testing.assert_allclose(whole[periods:], motion[:-periods], atol=1e-9)
    np.testing.assert_allclose(whole[:periods], 2.0 * motion[0] - motion[periods:0:-1], atol=1e-9)
    between = late(channels, ((periods - 0.5) * PERIOD_S,), PERIOD_S)[0]
    assert np.std(between[100:]) == pytest.approx(np.std(motion[100:]), rel=0.01)
