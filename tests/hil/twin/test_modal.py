"""Modes: orthogonality, the rigid body, Eq. 5, truncation, and exact discretisation against scipy's expm."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, one_mass, serial_chain, seven_dof, two_mass
from hil.twin.structure.modal import Modal, discretise, modal, truncate

LEAD_M = 0.010
R = LEAD_M / (2.0 * pi)

chains = st.integers(2, 10).flatmap(
    lambda n: st.builds(
        lambda j, k, xi: serial_chain(j, k, xi, LEAD_M),
        st.lists(st.floats(1e-5, 1e-2), min_size=n, max_size=n),
        st.lists(st.floats(1e2, 1e5), min_size=n - 1, max_size=n - 1),
        st.floats(0.0, 0.9),
    )
)


@given(chains)
def test_modes_are_orthogonal_ascending_and_free(chain) -> None:
    modes = modal(chain)
    phi, w = modes.shape, modes.frequency_rad_s
    np.testing.assert_allclose(phi.T @ chain.inertia_kg_m2 @ phi, np.eye(w.size), atol=1e-10)
    stiffness = phi.T @ chain.stiffness_n_m_rad @ phi
    np.testing.assert_allclose(stiffness, np.diag(w**2), atol=1e-10 * w[-1] ** 2)
    assert w[0] == 0.0
    assert np.all(np.diff(w) > 0.0)
    assert np.all(phi[chain.motor] >= 0.0)
    rigid = 1.0 / np.sqrt(np.trace(chain.inertia_kg_m2))
    np.testing.assert_allclose(phi[:, 0], rigid, rtol=1e-6)
    np.testing.assert_allclose(modes.transmission, chain.transmission @ phi)


def test_the_rigid_body_of_the_seven_dof_leaves_the_screw_axially_at_rest() -> None:
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.03)
    modes = modal(chain)
    phi = modes.shape
    np.testing.assert_allclose(phi.T @ chain.inertia_kg_m2 @ phi, np.eye(7), atol=1e-12)
    np.testing.assert_allclose(np.delete(phi[:, 0], 4), phi[0, 0], rtol=1e-9)
    assert abs(phi[4, 0]) < 1e-9 * phi[0, 0]
    assert modes.transmission[0] == pytest.approx(0.0, abs=1e-9 * phi[0, 0])


def test_two_mass_shapes_are_eq_5_with_its_sign_corrected() -> None:
    m1, m2 = 335.0, 384.0
    total = m1 + m2
    expected = np.array(
        [
            [1 / np.sqrt(total), np.sqrt(m2 / (m1 * total))],
            [1 / np.sqrt(total), -np.sqrt(m1 / (m2 * total))],
        ]
    )
    np.testing.assert_allclose(modal(two_mass(m1, m2, 5.64e7, 0.03, LEAD_M)).shape * R, expected, rtol=1e-12)


def test_the_second_mode_is_axial_and_the_third_torsional() -> None:
    """Sec. 3.2.1: "the second mode has mainly an axial behavior", the third "is mainly torsional"."""
    chain = seven_dof(RECONSTRUCTED_TABLE_1, 0.03)
    phi = modal(chain).shape
    nut_to_table = np.abs(phi[5] - phi[6])
    screw_twist = np.abs(phi[2] - phi[3])
    assert nut_to_table[1] > 5.0 * screw_twist[1]
    assert screw_twist[2] > nut_to_table[2]


def test_truncation_keeps_the_lowest_modes() -> None:
    modes = modal(seven_dof(RECONSTRUCTED_TABLE_1, 0.03))
    three = truncate(modes, 3)
    assert three.shape.shape == (7, 3)
    np.testing.assert_array_equal(three.frequency_rad_s, modes.frequency_rad_s[:3])
    np.testing.assert_array_equal(three.transmission, modes.transmission[:3])
    for count in (0, 8):
        with pytest.raises(ValueError, match="modes must lie between 1 and 7"):
            truncate(modes, count)


def one_mode(frequency_rad_s: float, damping_ratio: float) -> Modal:
    one = np.ones((1, 1))
    return Modal(np.array([frequency_rad_s]), one, np.array([damping_ratio]), 0, 0, np.zeros(1), np.zeros(1))


@given(
    frequency_rad_s=st.one_of(st.just(0.0), st.floats(1.0, 5e4)),
    damping_ratio=st.floats(0.0, 0.99),
    period_s=st.floats(1e-6, 2e-3),
)
@settings(max_examples=300)
def test_discretisation_is_the_matrix_exponential(frequency_rad_s, damping_ratio, period_s) -> None:
    w, xi = frequency_rad_s, damping_ratio
    d = discretise(one_mode(w, xi), period_s)
    # scaled to the time step, so that the matrix exponential is well conditioned
    generator = np.array([[0.0, 1.0, 0.0], [-w * w * period_s**2, -2 * xi * w * period_s, 1.0], [0, 0, 0]])
    exact = expm(generator)
    found = np.array(
        [
            [d.a11[0], d.a12[0] / period_s, d.b1[0] / period_s**2],
            [d.a21[0] * period_s, d.a22[0], d.b2[0] / period_s],
        ]
    )
    # expm itself loses digits as |generator| = (w T)^2 grows
    np.testing.assert_allclose(found, exact[:2], rtol=1e-9, atol=1e-12 * max(1.0, (w * period_s) ** 2))


@given(st.floats(1.0, 1e4), st.floats(0.0, 0.9), st.floats(1e-5, 1e-3))
def test_two_half_steps_are_one_step(frequency_rad_s, damping_ratio, period_s) -> None:
    mode = one_mode(frequency_rad_s, damping_ratio)
    whole, half = discretise(mode, period_s), discretise(mode, period_s / 2)
    step = np.array([[half.a11[0], half.a12[0]], [half.a21[0], half.a22[0]]])
    force = np.array([half.b1[0], half.b2[0]])
    scale = np.array([[1.0, 1 / frequency_rad_s], [frequency_rad_s, 1.0]])
    twice = step @ step
    expected = np.array([[whole.a11[0], whole.a12[0]], [whole.a21[0], whole.a22[0]]])
    assert np.all(np.abs(twice - expected) < 1e-12 * scale)
    np.testing.assert_allclose(step @ force + force, [whole.b1[0], whole.b2[0]], rtol=1e-9, atol=1e-18)


def test_an_undamped_free_mode_keeps_its_energy_for_a_million_steps() -> None:
    d = discretise(one_mode(2 * pi * 89.4, 0.0), 1e-3)
    step = np.array([[d.a11[0], d.a12[0]], [d.a21[0], d.a22[0]]])
    late = np.linalg.matrix_power(step, 1_000_000)
    assert abs(np.linalg.det(late)) == pytest.approx(1.0, rel=1e-8)


def test_a_rigid_axis_under_constant_force_falls_as_half_a_t_squared() -> None:
    d = discretise(modal(one_mass(4.0)), 1e-3)
    x = v = 0.0
    shape = 0.5  # 1 / sqrt(4 kg)
    for _ in range(1000):
        x, v = d.a11[0] * x + d.a12[0] * v + d.b1[0] * shape * 8.0, d.a22[0] * v + d.b2[0] * shape * 8.0
    assert shape * x == pytest.approx(0.5 * 2.0 * 1.0**2, rel=1e-12)
    assert shape * v == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("damping_ratio", [-0.01, 1.0])
def test_a_mode_that_does_not_oscillate_is_refused(damping_ratio: float) -> None:
    with pytest.raises(ValueError, match=r"damping_ratio must lie in \[0, 1\)"):
        discretise(one_mode(100.0, damping_ratio), 1e-3)
