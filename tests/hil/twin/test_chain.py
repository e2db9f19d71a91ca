"""The chain against the source: Eq. 20, 22, 23, the nut anywhere on its travel, elasticity formulas."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.twin.structure import ballscrew
from hil.twin.structure.ballscrew import equivalent_two_mass
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, Chain, one_mass, serial_chain, seven_dof, two_mass
from hil.twin.structure.modal import modal

LEAD_M = 0.010
R = LEAD_M / (2.0 * pi)


def frequencies_hz(chain: Chain) -> np.ndarray:
    return modal(chain).frequency_rad_s / (2.0 * pi)


def test_seven_dof_frequencies_are_those_of_eq_20_within_a_quarter_percent() -> None:
    found = frequencies_hz(seven_dof(RECONSTRUCTED_TABLE_1, 0.03))
    assert found[0] == 0.0
    np.testing.assert_allclose(found[1:], [144, 432, 870, 2474, 2909, 3900], rtol=0.0025)


def test_two_mass_frequency_is_that_of_eq_2() -> None:
    found = frequencies_hz(two_mass(335.0, 384.0, 5.64e7, 0.03, LEAD_M))
    assert found[1] == pytest.approx(np.sqrt(5.64e7 * (335 + 384) / (335 * 384)) / (2 * pi), rel=1e-12)
    assert found[1] == pytest.approx(89.4, abs=0.05)


def test_equivalent_two_mass_is_eq_22_and_23() -> None:
    found = equivalent_two_mass(RECONSTRUCTED_TABLE_1)
    assert found.motor_mass_kg == pytest.approx(335.0, rel=1e-12)
    assert found.table_mass_kg == pytest.approx(384.0, rel=1e-4)
    assert found.stiffness_parallel_n_m == pytest.approx(5.64e7, rel=2e-3)


@pytest.mark.parametrize("nut_position_m", [None, 0.0, 0.1, 0.4])
def test_the_series_stiffness_is_the_static_stiffness_of_the_seven_dof_chain(nut_position_m) -> None:
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.03, nut_position_m)
    # motor held, unit torque on the table: its angle is the compliance seen there
    free = chain.stiffness_n_m_rad[1:, 1:]
    compliance = np.linalg.solve(free, np.eye(6)[-1])[-1]
    series = equivalent_two_mass(RECONSTRUCTED_TABLE_1, nut_position_m).stiffness_series_n_m
    assert 1.0 / compliance / R**2 == pytest.approx(series, rel=1e-9)


def test_at_the_reference_nut_position_the_reconstructed_stiffnesses_stand() -> None:
    inertias, stiffnesses = RECONSTRUCTED_TABLE_1.reduced()
    expected_axial = np.array([1.96e8, 6.40e8, 6.53e7]) * R**2
    np.testing.assert_allclose(stiffnesses, [3.94e4, 1.10e4, 4.17e3, *expected_axial], rtol=1e-12)
    expected_masses = np.array([5.25, 3.49, 58.8]) * R**2
    expected = [335 * R**2, 1.04e-4, 4.89e-5, 6.62e-4, *expected_masses]
    np.testing.assert_allclose(inertias, expected, rtol=1e-12)


def test_nearer_to_the_motor_the_screw_is_stiffer_in_torsion_and_stiffest_axially_at_either_end() -> None:
    positions = np.linspace(0.0, 0.4, 9)
    torsion = [RECONSTRUCTED_TABLE_1.screw_torsion_n_m_rad(x) for x in positions]
    axial = np.array([RECONSTRUCTED_TABLE_1.screw_axial_n_m(x) for x in positions])
    assert np.all(np.diff(torsion) < 0.0)
    np.testing.assert_allclose(axial, axial[::-1], rtol=1e-12)
    assert np.all(np.diff(axial[:5]) < 0.0)
    # torsion by G J / L: "two times or more" (Sec. 3.3.3) at 100 mm, lengths from the front bearing
    ratio = RECONSTRUCTED_TABLE_1.screw_torsion_n_m_rad(0.1) / torsion[4]
    assert ratio == pytest.approx(210 / 110, rel=1e-12)


def test_a_softer_back_bearing_shifts_the_stiff_side_to_the_front() -> None:
    parameters = replace(RECONSTRUCTED_TABLE_1, back_bearing_stiffness_n_m=4e7)
    assert parameters.screw_axial_n_m(0.05) > parameters.screw_axial_n_m(0.35)


@pytest.mark.parametrize("nut_position_m", [-0.01, 0.41, 5.0, float("nan")])
def test_a_nut_outside_the_bearings_is_refused(nut_position_m: float) -> None:
    with pytest.raises(ValueError, match=r"nut_position_m must lie between -0.01 and 0.41 m"):
        seven_dof(RECONSTRUCTED_TABLE_1, 0.03, nut_position_m)


def test_the_elasticity_formulas_of_the_appendix() -> None:
    assert ballscrew.round_area(0.032) == pytest.approx(8.0425e-4, rel=1e-4)
    assert ballscrew.torsional_stiffness(816.3, 0.5) == pytest.approx(1632.6)
    assert ballscrew.axial_stiffness(2.06e11 * 8.0425e-4, 0.5) == pytest.approx(3.3135e8, rel=1e-3)
    assert ballscrew.supported_screw_stiffness(2.0, 2.0, 4.0, 4.0) == pytest.approx(3.0)


@given(
    inertias=st.lists(st.floats(1e-5, 1e-2), min_size=1, max_size=12),
    data=st.data(),
)
def test_a_serial_chain_is_symmetric_free_to_move_and_sums_its_inertia(inertias, data) -> None:
    n = len(inertias)
    stiffnesses = data.draw(st.lists(st.floats(1e2, 1e5), min_size=n - 1, max_size=n - 1))
    chain = serial_chain(inertias, stiffnesses, 0.02, LEAD_M)
    k = chain.stiffness_n_m_rad
    np.testing.assert_array_equal(k, k.T)
    np.testing.assert_allclose(k @ np.ones(n), 0.0, atol=1e-9 * max(stiffnesses, default=1.0))
    assert np.trace(chain.inertia_kg_m2) == pytest.approx(sum(inertias))
    assert chain.damping_ratio[0] == 0.0
    assert (chain.motor, chain.table) == (0, n - 1)


def test_a_serial_chain_of_two_is_the_two_mass_chain() -> None:
    expected = two_mass(335.0, 384.0, 5.64e7, 0.03, LEAD_M)
    found = serial_chain([335 * R**2, 384 * R**2], [5.64e7 * R**2], 0.03, LEAD_M, names=["motor", "table"])
    for name in ("inertia_kg_m2", "stiffness_n_m_rad", "damping_ratio", "transmission"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-12)
    assert found.transmission_stiffness_n_m_rad == pytest.approx(expected.transmission_stiffness_n_m_rad)
    assert found.names == expected.names


def test_the_transmission_spring_carries_the_force_on_the_table() -> None:
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.03)
    torque = 0.7
    angle = np.append(0.0, np.linalg.solve(chain.stiffness_n_m_rad[1:, 1:], torque * np.eye(6)[-1]))
    # pulling the table forward stretches the nut spring: motor side minus table side is negative
    carried = chain.transmission_stiffness_n_m_rad * (chain.transmission @ angle)
    assert carried == pytest.approx(-torque, rel=1e-9)


def test_the_screw_gives_by_torsion_and_along_its_axis_one_after_the_other() -> None:
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.03)
    torque = 0.7
    angle = np.append(0.0, np.linalg.solve(chain.stiffness_n_m_rad[1:, 1:], torque * np.eye(6)[-1]))
    _, stiffnesses = RECONSTRUCTED_TABLE_1.reduced()
    assert chain.screw @ angle == pytest.approx(-torque / stiffnesses[2] - torque / stiffnesses[3], rel=1e-9)
    assert chain.screw_stiffness_n_m_rad * (chain.screw @ angle) == pytest.approx(-torque, rel=1e-9)


def test_sides_of_the_transmission() -> None:
    """Four of the seven coordinates turn with the motor; nut bracket and table are beyond the nut."""
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.03)
    assert chain.side(chain.motor).tolist() == [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    assert chain.side(chain.table).tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]
    assert one_mass(95.0).side(0).tolist() == [1.0]


def test_one_mass_moves_as_a_whole() -> None:
    chain = one_mass(95.109)
    assert chain.inertia_kg_m2[0, 0] == pytest.approx(95.109)  # r = 1: newtons and metres
    assert frequencies_hz(chain)[0] == 0.0
    assert one_mass(719.0, LEAD_M).inertia_kg_m2[0, 0] == pytest.approx(719.0 * R**2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 1.0], [1.0, 1.0], 0.0, LEAD_M), "stiffnesses_n_m_rad must have one entry fewer"),
        (([1.0, 1.0, 1.0], [1.0, 1.0], [0.1, 0.1, 0.1], LEAD_M), "damping_ratio must be one number or 2"),
    ],
)
def test_lengths_that_do_not_fit_are_refused(arguments, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        serial_chain(*arguments)
    with pytest.raises(ValueError, match="names must have one entry per inertia"):
        serial_chain([1.0], [], 0.0, LEAD_M, names=["a", "b"])
