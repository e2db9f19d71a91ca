"""Contacts that yield before they slide: Dahl's curve, Maxwell slip elements with Masing's rules, and their steps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.twin.stepping import contact
from hil.twin.stepping.contact import Resistance

STIFFNESS, BOUND, STEP_S = 1000.0, 2.0, 1e-4
YIELD_M = BOUND / STIFFNESS
LIGHT = 1e-12  # a body so heavy that no friction changes its velocity: velocity gained per torque


def friction_along(path, elements=None):
    """Friction after each step of a path of positions [in units of Fc / K], moved along without inertia."""
    elements = np.zeros(contact.ELEMENTS) if elements is None else elements
    forces = []
    for step in np.diff(path, prepend=0.0):
        speed = step * YIELD_M / STEP_S
        contact.slipping(speed, LIGHT, Resistance(BOUND, 0.0, 0.0, 0.0), STIFFNESS, elements, STEP_S, speed)
        forces.append(elements.sum())
    return np.array(forces)


def dahl_along(path):
    """The same of a contact after Dahl."""
    deflection, forces = 0.0, []
    for step in np.diff(path, prepend=0.0):
        speed = step * YIELD_M / STEP_S
        _, deflection = contact.elastic(
            speed, LIGHT, Resistance(BOUND, 0.0, 0.0, 0.0), STIFFNESS, deflection, STEP_S, speed
        )
        forces.append(STIFFNESS * deflection)
    return np.array(forces)


def swing(steps):
    """Positions of a mass of 1 kg that is pushed at 3 N for 0.1 s and let go on a contact after Dahl."""
    step_s, position, speed, deflection = 0.3 / steps, 0.0, 0.0, 0.0
    for tick in range(steps):
        free = speed + step_s * (3.0 if 3 * tick < steps else 0.0)
        force, deflection = contact.elastic(
            free, step_s, Resistance(BOUND, 0.0, 0.1, 0.0), STIFFNESS, deflection, step_s, speed
        )
        before, speed = speed, free - step_s * force
        position += 0.5 * step_s * (before + speed)
    return position


def test_shares_make_the_whole() -> None:
    assert contact.STIFFNESS_SHARES.sum() == pytest.approx(1.0)
    assert contact.YIELD_SHARES.sum() == pytest.approx(1.0)
    assert (contact.STIFFNESS_SHARES > 0.0).all()
    assert (contact.YIELD_SHARES > 0.0).all()


@pytest.mark.parametrize("steps", [6, 60, 600])
def test_dahls_curve_is_followed_whatever_the_steps(steps: int) -> None:
    path = np.linspace(0.0, 3.0, steps + 1)[1:]
    np.testing.assert_allclose(dahl_along(path) / BOUND, 1.0 - np.exp(-path), atol=1e-7)
    turned = dahl_along([*path, *(3.0 - path)])[steps:] / BOUND
    begin = 1.0 - np.exp(-3.0)
    np.testing.assert_allclose(turned, -1.0 + (begin + 1.0) * np.exp(-path), atol=1e-7)


def test_a_step_of_an_elastic_contact_is_of_second_order() -> None:
    exact = swing(96_000)
    errors = [abs(swing(steps) - exact) for steps in (300, 1200)]
    assert errors[0] < 0.01 * abs(exact)
    assert errors[1] < errors[0] / 8.0


def test_a_swing_that_no_step_resolves_dies_down() -> None:
    gain, stiffness, speed, deflection, speeds = 1.0, 1e9, 0.01, 0.0, []
    for _ in range(50):
        force, deflection = contact.elastic(
            speed, gain, Resistance(1e3, 0.0, 0.0, 0.0), stiffness, deflection, STEP_S, speed
        )
        speed -= gain * force
        speeds.append(abs(speed))
    assert speeds[-1] < 1e-3 * speeds[0]


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


@given(
    free=st.floats(-0.5, 0.5),
    gain=st.floats(1e-3, 10.0),
    viscous=st.floats(0.0, 5.0),
    bound=st.floats(0.0, 3.0),
    stiffness=st.floats(1.0, 1e6),
    shift=st.floats(-0.5, 0.5),
    before=st.floats(-0.5, 0.5),
    start=st.lists(st.floats(-1.0, 1.0), min_size=contact.ELEMENTS, max_size=contact.ELEMENTS),
)
@settings(max_examples=200)
def test_the_step_solves_its_equation(free, gain, viscous, bound, stiffness, shift, before, start) -> None:
    limits = contact.YIELD_SHARES * bound
    elements = limits * np.array(start)
    first = elements.copy()
    torque = contact.slipping(free, gain, Resistance(bound, viscous, shift, 0.0), stiffness, elements, STEP_S, before)
    velocity = free - gain * torque
    late = contact._late(gain, stiffness, STEP_S)
    travel = STEP_S * ((1.0 - late) * before + late * velocity)
    moved = np.clip(first + contact.STIFFNESS_SHARES * stiffness * travel, -limits, limits)
    if torque != free / gain and not np.array_equal(elements, first):  # else friction holds it, or all slip on
        mean = (1.0 - late) * first.sum() + late * moved.sum()
        assert torque == pytest.approx(mean + shift + viscous * velocity, abs=1e-8 * max(1.0, abs(torque)))
        np.testing.assert_allclose(elements, moved, atol=1e-8 * max(bound, 1.0))


@given(
    free=st.floats(-0.5, 0.5),
    gain=st.floats(1e-3, 10.0),
    viscous=st.floats(0.0, 5.0),
    bound=st.floats(1e-3, 3.0),
    stiffness=st.floats(1.0, 1e6),
    shift=st.floats(-0.5, 0.5),
    before=st.floats(-0.5, 0.5),
    start=st.floats(-1.0, 1.0),
)
@settings(max_examples=300)
def test_so_does_that_of_dahls_contact(free, gain, viscous, bound, stiffness, shift, before, start) -> None:
    pull = start * bound
    torque, after = contact.elastic(
        free, gain, Resistance(bound, viscous, shift, 0.0), stiffness, pull / stiffness, STEP_S, before
    )
    velocity = free - gain * torque
    late = contact._late(gain, stiffness, STEP_S)
    travel = STEP_S * ((1.0 - late) * before + late * velocity)
    target = np.copysign(bound, travel)
    wanted = target + (pull - target) * np.exp(-stiffness * abs(travel) / bound)
    assert abs(stiffness * after) <= bound * (1.0 + 1e-12)
    # what may be missed of the velocity, as torque of the contact
    missed = 2.0 * contact._SOLVED * (abs(free) + gain * bound)
    solved = 1e-6 * bound + missed * (viscous + stiffness * STEP_S)
    if torque != free / gain:
        assert stiffness * after == pytest.approx(wanted, abs=solved)
        assert torque == pytest.approx((1.0 - late) * pull + late * wanted + shift + viscous * velocity, abs=solved)
