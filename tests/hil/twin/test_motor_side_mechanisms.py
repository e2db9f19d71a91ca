"""Each mechanism of friction and load on the motor side has the property that an engineer would check."""

from math import e, pi

import pytest
from contributions import AT_REST, PROPERTY, call, moments
from hypothesis import given
from hypothesis import strategies as st

torques = st.floats(-12.0, 12.0)
phases = st.floats(-2.0 * pi, 2.0 * pi)


@given(load=torques, at=moments)
@PROPERTY
def test_constant_load_is_held_by_the_same_motor_torque(load, at) -> None:
    assert call("constant_load", load, at, load_torque_n_m=load) == 0.0


@given(offset=st.floats(-1.0, 1.0), level=st.floats(1.0, 3.0), at=moments)
@PROPERTY
def test_asymmetric_friction_shifts_the_band(offset, level, at) -> None:
    shift = call("asymmetric_friction", 0.0, at, offset_torque_n_m=offset)
    forward, backward = shift + level, shift - level
    assert (forward + backward) / 2.0 == pytest.approx(offset)
    assert forward >= 0.0 >= backward  # still opposes both directions


@given(offset=st.floats(-1.0, 1.0), velocity=st.floats(0.0, 300.0))
@PROPERTY
def test_asymmetry_with_speed_is_the_same_torque_both_ways(offset, velocity) -> None:
    def torque(speed):
        return call("asymmetric_friction", 0.0, AT_REST._replace(velocity=speed), variant=1, offset_torque_n_m=offset)

    assert torque(AT_REST.viscous_speed) == pytest.approx(offset)
    assert torque(velocity) == pytest.approx(offset * velocity / AT_REST.viscous_speed)
    assert torque(-velocity) == torque(velocity)


@given(coulomb=st.floats(0.1, 5.0), static=st.floats(0.1, 8.0), stribeck=st.floats(0.01, 20.0))
@PROPERTY
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


@given(
    level=st.floats(0.1, 5.0),
    fraction=st.floats(0.0, 1.0),
    period=st.floats(1e-3, 1.0),
    phase=phases,
    position=st.floats(-0.5, 0.5),
)
@PROPERTY
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
@PROPERTY
def test_presliding_gives_the_contact_its_stiffness(stiffness, at) -> None:
    assert call("presliding_hysteresis", 0.0, at, stiffness_n_m_rad=stiffness) == stiffness


@given(quadratic=st.floats(-1e-3, 1e-3), velocity=st.floats(-300.0, 300.0))
@PROPERTY
def test_quadratic_drag_quadruples_at_double_speed(quadratic, velocity) -> None:
    def drag(speed):
        return call(
            "nonlinear_viscous_friction", 0.0, AT_REST._replace(velocity=speed), quadratic_n_m_s2_rad2=quadratic
        )

    assert drag(2.0 * velocity) == pytest.approx(4.0 * drag(velocity))
    assert drag(-velocity) == -drag(velocity)
    assert drag(velocity) * velocity * quadratic >= 0.0  # q > 0 takes power, q < 0 gives some back


@given(quadratic=st.floats(0.0, 1e-3), velocity=st.floats(0.0, 300.0))
@PROPERTY
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


@given(fraction=st.floats(-0.95, 5.0), tau=st.floats(1.0, 1e4))
@PROPERTY
def test_friction_drift_starts_cold_and_settles(fraction, tau) -> None:
    cold, at_tau, warm = (
        call("friction_drift", 1.0, AT_REST._replace(time_s=multiple * tau), fraction=fraction, time_constant_s=tau)
        for multiple in (0.0, 1.0, 50.0)
    )
    assert cold == 1.0
    assert at_tau == pytest.approx(1.0 + fraction * (1.0 - 1.0 / e))
    assert warm == pytest.approx(1.0 + fraction)
