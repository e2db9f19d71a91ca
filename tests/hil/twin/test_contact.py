"""Contacts of Maxwell slip elements: the virgin curve, Masing's rules, and the implicit step against plain stepping."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.twin import contact

STIFFNESS, BOUND, STEP_S = 1000.0, 2.0, 1e-4
YIELD_M = BOUND / STIFFNESS
LIGHT = 1e-12      # a body so heavy that no friction changes its velocity: velocity gained per torque


def friction_along(path, elements=None):
    """Friction at each point of a path of positions [in units of Fc / K], moved along without inertia."""
    elements = np.zeros(contact.ELEMENTS) if elements is None else elements
    return np.array([contact.slipping(step * YIELD_M / STEP_S, LIGHT, BOUND, 0.0, 0.0, 0.0, STIFFNESS, elements, STEP_S)
                     for step in np.diff(path, prepend=0.0)])


def test_shares_make_the_whole() -> None:
    assert contact.STIFFNESS_SHARES.sum() == pytest.approx(1.0)
    assert contact.YIELD_SHARES.sum() == pytest.approx(1.0)
    assert (contact.STIFFNESS_SHARES > 0.0).all()
    assert (contact.YIELD_SHARES > 0.0).all()


def test_the_first_loading_follows_the_dahl_curve_and_ends_at_the_bound() -> None:
    path = np.linspace(0.0, 6.0, 601)
    force = friction_along(path) / BOUND
    np.testing.assert_allclose(force, 1.0 - np.exp(-path), atol=0.03)
    assert force[-1] == pytest.approx(1.0, rel=1e-9)


def test_a_reversed_contact_is_as_stiff_as_at_first_and_twice_as_wide() -> None:
    """Masing's rule, which the Dahl model breaks: it is twice as stiff after a reversal from full sliding."""
    path = np.linspace(0.0, 5.0, 501)
    elements = np.zeros(contact.ELEMENTS)
    first = friction_along(path, elements)
    back = friction_along(-2.0 * path, elements)
    np.testing.assert_allclose(BOUND - back, 2.0 * first, atol=1e-6)


def test_a_closed_loop_ends_where_it_began() -> None:
    """The second rule: a loop within a loop closes, and the outer curve goes on as if it had not been."""
    elements = np.zeros(contact.ELEMENTS)
    begin = friction_along(np.linspace(0.0, 1.0, 101), elements)[-1]
    friction_along(np.linspace(0.0, -0.6, 61), elements)
    end = friction_along(np.linspace(0.0, 0.6, 61), elements)[-1]
    assert end == pytest.approx(begin, rel=1e-9)


@given(free=st.floats(-0.5, 0.5), gain=st.floats(1e-3, 10.0), viscous=st.floats(0.0, 5.0), bound=st.floats(0.0, 3.0),
       stiffness=st.floats(1.0, 1e6), shift=st.floats(-0.5, 0.5),
       start=st.lists(st.floats(-1.0, 1.0), min_size=contact.ELEMENTS, max_size=contact.ELEMENTS))
@settings(max_examples=200, deadline=None)
def test_the_step_solves_its_equation(free, gain, viscous, bound, stiffness, shift, start) -> None:
    limits = contact.YIELD_SHARES * bound
    elements = limits * np.array(start)
    before = elements.copy()
    torque = contact.slipping(free, gain, bound, viscous, shift, 0.0, stiffness, elements, STEP_S)
    velocity = free - gain * torque
    moved = np.clip(before + contact.STIFFNESS_SHARES * stiffness * STEP_S * velocity, -limits, limits)
    if torque != free / gain:      # else friction holds it
        assert torque == pytest.approx(moved.sum() + shift + viscous * velocity, abs=1e-9 * max(1.0, abs(torque)))
        np.testing.assert_allclose(elements, moved, atol=1e-9 * max(bound, 1.0))
    assert velocity * free >= 0.0 or abs(velocity) <= gain * (bound + abs(shift))
