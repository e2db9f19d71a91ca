"""A mechanism that acts twice at once: each with parameters of its own, in any order, and no more often."""

import numpy as np
import pytest

from hil.bench.bench_file import load_bench
from hil.twin.axis import Twin
from hil.twin.library import LIBRARY, SLOTS
from hil.twin.physics import Active

BENCH = load_bench("reference")
TORQUE_N_M = 3.0 * np.sin(np.arange(600) * 2.0 * np.pi / 300.0)
TWICE = {
    "cogging_torque": ((0.2, 6.0, 0.3), (0.1, 15.0, -1.0)),
    "torque_ripple": ((0.05, 6.0, 0.3), (0.03, 15.0, -1.0)),
    "position_dependent_friction": ((0.3, 0.02, 0.3), (0.2, 0.005, -1.0)),
}


def motion(*active):
    """The motor [rad] under a torque that moves it to and fro."""
    return Twin(BENCH.axis.physics(), BENCH.gains, active).drive(TORQUE_N_M).motor_position


def test_what_has_a_period_or_an_order_may_act_twice_and_a_stop_at_each_end() -> None:
    assert {mechanism.id for mechanism in LIBRARY if mechanism.most > 1} == {*TWICE, "end_stop"}
    assert [mechanism.id for mechanism in SLOTS if mechanism.id in TWICE].count("cogging_torque") == 4


@pytest.mark.parametrize("effect", TWICE)
def test_both_act_each_with_its_own_parameters(effect) -> None:
    first, second = (Active(effect, values) for values in TWICE[effect])
    both = motion(first, second)
    np.testing.assert_allclose(motion(second, first), both, rtol=1e-9, atol=1e-12)
    for one in (first, second):
        assert np.ptp(both - motion(one)) > 1e-3


def test_a_stop_to_either_side_of_one_edge_is_a_spring() -> None:
    stops = [Active("end_stop", (2e5, 0.001), variant) for variant in (0, 1)]
    np.testing.assert_allclose(motion(*stops), motion(Active("spring_load", (2e5, 0.001))), rtol=1e-9, atol=1e-12)


def test_two_alike_are_one_of_twice_the_strength() -> None:
    half, whole = Active("cogging_torque", (0.1, 6.0, 0.3)), Active("cogging_torque", (0.2, 6.0, 0.3))
    np.testing.assert_allclose(motion(half, half), motion(whole), rtol=1e-9, atol=1e-12)


def test_no_more_often_than_there_is_room() -> None:
    with pytest.raises(ValueError, match="cogging_torque must act at most 4 times"):
        motion(*[Active("cogging_torque", (0.1, order, 0.0)) for order in (6.0, 12.0, 18.0, 24.0, 36.0)])
