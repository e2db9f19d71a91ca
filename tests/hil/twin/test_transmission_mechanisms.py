"""Mechanisms of transmission and structure change table position, stiffness and modes as their equations say."""

from math import e, pi

import numpy as np
import pytest
from contributions import AT_REST, RATIO_M, call
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Stage
from hil.twin.structure.chain import one_mass, two_mass
from hil.twin.structure.modal import modal

deflections = st.floats(-0.5, 0.5)  # rad: +-0.8 mm at the table
lengths = st.floats(0.0, 1e-3)
positions = st.floats(-1.0, 1.0)


def unloaded_table(effect, angle_rad, *, time_s=0.0, variant=0, **parameters):
    """Table position [m] with the motor at an angle and no torque in the spring."""

    def deflection(x):
        at = AT_REST._replace(time_s=time_s, angle_rad=angle_rad, table_position_m=x)
        return call(effect, angle_rad - x / RATIO_M, at, variant=variant, **parameters)

    rigid = RATIO_M * angle_rad
    return brentq(deflection, rigid - 0.02, rigid + 0.02, xtol=1e-15)


@given(
    angle=st.floats(-600.0, 600.0), amplitude=st.floats(0.0, 1e-4), phase=st.floats(-pi, pi), third=st.floats(0.0, 1e-5)
)
def test_periodic_lead_error_moves_the_table_with_the_angle(angle, amplitude, phase, third) -> None:
    x = unloaded_table(
        "periodic_lead_error",
        angle,
        amplitude_m=amplitude,
        phase_rad=phase,
        amplitude_2_m=0.0,
        phase_2_rad=0.0,
        amplitude_3_m=third,
        phase_3_rad=1.0,
    )
    error = amplitude * np.sin(angle + phase) + third * np.sin(3.0 * angle + 1.0)
    assert x - RATIO_M * angle == pytest.approx(error, abs=1e-11)


@given(angle=st.floats(-600.0, 600.0), slope=st.floats(-1e-3, 1e-3))
def test_cumulative_lead_error_grows_along_the_travel(angle, slope) -> None:
    ahead = unloaded_table("cumulative_lead_error", angle, slope_m_m=slope) - RATIO_M * angle
    assert ahead == pytest.approx(slope * RATIO_M * angle, rel=2e-3, abs=1e-12)


@given(angle=st.floats(-600.0, 600.0), growth=st.floats(-1e-3, 1e-3), tau=st.floats(1.0, 1e4))
def test_thermal_growth_starts_cold_and_settles(angle, growth, tau) -> None:
    cold, at_tau, warm = (
        unloaded_table(
            "thermal_growth", angle, time_s=multiple * tau, relative_growth=growth, time_constant_s=tau, bearing_m=0.0
        )
        for multiple in (0.0, 1.0, 50.0)
    )
    assert cold == pytest.approx(RATIO_M * angle, abs=1e-12)
    assert warm == pytest.approx(unloaded_table("cumulative_lead_error", angle, slope_m_m=growth), abs=1e-12)
    assert at_tau - cold == pytest.approx((1.0 - 1.0 / e) * (warm - cold), rel=2e-3, abs=1e-12)


@given(bearing=st.floats(-1.0, 1.0), growth=st.floats(-1e-3, 1e-3))
def test_a_screw_does_not_grow_at_its_bearing(bearing, growth) -> None:
    angle = bearing / RATIO_M
    at = unloaded_table(
        "thermal_growth", angle, time_s=9.0, relative_growth=growth, time_constant_s=3.0, bearing_m=bearing
    )
    assert at == pytest.approx(bearing, abs=1e-12)


@given(deflection=deflections, gap=lengths)
def test_backlash_is_lost_motion(deflection, gap) -> None:
    bent = call("backlash", deflection, gap_m=gap)
    assert RATIO_M * abs(bent) == pytest.approx(max(RATIO_M * abs(deflection) - gap / 2.0, 0.0), abs=1e-15)
    assert bent * deflection >= 0.0


@given(deflection=deflections, zone=lengths)
def test_preload_loss_without_any_stiffness_left_is_backlash(deflection, zone) -> None:
    soft = call("preload_loss", deflection, zone_m=zone, stiffness_ratio=0.0)
    assert soft == pytest.approx(call("backlash", deflection, gap_m=zone), abs=1e-15)


@given(a=deflections, b=deflections, zone=lengths, ratio=st.floats(0.0, 1.0))
def test_preload_loss_is_continuous_with_the_two_stiffnesses(a, b, zone, ratio) -> None:
    low, high = sorted((a, b))
    bent = [call("preload_loss", q, zone_m=zone, stiffness_ratio=ratio) for q in (low, high)]
    assert ratio * (high - low) - 1e-12 <= bent[1] - bent[0] <= high - low + 1e-12
    half = zone / 2.0 / RATIO_M
    if max(abs(low), abs(high)) <= half:
        assert bent[1] - bent[0] == pytest.approx(ratio * (high - low), abs=1e-12)
    if low >= half:
        assert bent[1] - bent[0] == pytest.approx(high - low, abs=1e-12)


@given(slope=st.floats(-10.0, 10.0), x=positions)
def test_position_dependent_stiffness_is_nominal_at_zero_and_never_negative(slope, x) -> None:
    def factor(position):
        return call(
            "position_dependent_stiffness", 1.0, AT_REST._replace(table_position_m=position), relative_slope=slope
        )

    assert factor(0.0) == 1.0
    assert factor(x) >= 0.0
    if slope * x > -1.0:
        assert factor(x) == pytest.approx(1.0 + slope * x)


def test_lead_errors_come_before_the_spring_that_they_bend() -> None:
    order = [mechanism.id for mechanism in LIBRARY if mechanism.variants[0].stage is Stage.TRANSMISSION]
    assert set(order[:3]) == {"periodic_lead_error", "cumulative_lead_error", "thermal_growth"}


chains = st.sampled_from([one_mass(95.0), two_mass(335.0, 384.0, 5.64e7, 0.03, 0.010)])
frequencies = st.floats(5.0, 400.0)
ratios = st.floats(1e-3, 3.0)


def with_structure(chain, frequency_hz, damping_ratio, mass_ratio):
    return BY_ID["structural_mode"].variants[0].contribution(chain, (frequency_hz, damping_ratio, mass_ratio))


@given(chain=chains, frequency=frequencies, ratio=ratios)
def test_structural_mode_absorbs_the_table_at_its_own_frequency(chain, frequency, ratio) -> None:
    """Den Hartog: a harmonic force on the table does not move it at the clamped frequency of the mass."""
    longer = with_structure(chain, frequency, 0.01, ratio)
    w2 = (2.0 * pi * frequency) ** 2
    force = np.eye(len(longer.names))[longer.table]
    response = np.linalg.solve(longer.stiffness_n_m_rad - w2 * longer.inertia_kg_m2, force)
    assert abs(response[longer.table]) < 1e-7 * np.abs(response).max()


@given(
    chain=st.sampled_from(
        [one_mass(95.0), two_mass(335.0, 384.0, 5.64e7, 0.03, 0.010), two_mass(335.0, 384.0, 5.64e7, 0.97, 0.010)]
    ),
    frequency=frequencies,
    ratio=ratios,
    damping=st.floats(1e-4, 0.9),
)
def test_structural_mode_adds_one_mode_and_keeps_the_rest(chain, frequency, ratio, damping) -> None:
    longer = with_structure(chain, frequency, damping, ratio)
    modes, before = modal(longer), modal(chain)
    assert modes.frequency_rad_s.size == before.frequency_rad_s.size + 1
    assert modes.frequency_rad_s[0] == 0.0
    rigid = np.ones(len(longer.names))
    np.testing.assert_allclose(longer.stiffness_n_m_rad @ rigid, 0.0, atol=1e-6 * longer.stiffness_n_m_rad.max())
    table = chain.inertia_kg_m2[chain.table, chain.table]
    assert longer.inertia_kg_m2.sum() == pytest.approx(chain.inertia_kg_m2.sum() + ratio * table)
    assert longer.damping_ratio[0] == 0.0
    assert (longer.damping_ratio[1:] > 0.0).all()
    assert (longer.damping_ratio < 1.0).all()
    resisting = longer.damping_n_m_s_rad
    np.testing.assert_allclose(resisting @ rigid, 0.0, atol=1e-6 * resisting.max())
    assert np.linalg.eigvalsh(resisting).min() > -1e-6 * resisting.max()
    assert modes.transmission.shape == modes.frequency_rad_s.shape


@given(frequency=frequencies, ratio=ratios)
def test_a_yielding_base_has_the_modes_of_the_chain_seen_from_the_ground(frequency: float, ratio: float) -> None:
    """Motor, table and base in absolute coordinates: the nut pulls table and base together, a spring holds the base."""
    motor, table, stiffness = 335.0, 384.0, 5.64e7
    chain = two_mass(motor, table, stiffness, 0.03, 2.0 * pi)
    longer = BY_ID["structural_mode"].variants[1].contribution(chain, (frequency, 0.01, ratio))
    base = table / ratio
    nut = np.array([1.0, -1.0, 1.0])
    held = np.diag([0.0, 0.0, (base + table) * (2.0 * pi * frequency) ** 2]) + stiffness * np.outer(nut, nut)
    expected = np.sort(np.linalg.eigvals(held / np.array([motor, table, base])[:, None]).real)[1:]
    np.testing.assert_allclose(modal(longer).frequency_rad_s[1:] ** 2, expected, rtol=1e-6)


@pytest.mark.parametrize(("frequency_hz", "mode"), [(20.0, 1), (400.0, 2)])
def test_structural_mode_damps_the_mode_it_brings(frequency_hz: float, mode: int) -> None:
    """The reference axis has its own mode at 89.4 Hz, damped by 0.03."""
    longer = with_structure(two_mass(335.0, 384.0, 5.64e7, 0.03, 0.010), frequency_hz, 0.11, 0.01)
    assert longer.damping_ratio[mode] == pytest.approx(0.11, rel=0.01)
    assert longer.damping_ratio[3 - mode] == pytest.approx(0.03, rel=0.01)
    assert modal(longer).frequency_rad_s[mode] == pytest.approx(2.0 * pi * frequency_hz, rel=0.01)
