"""Windows of an event as they are reported: joined, and as a train of equal ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, recorded

from hil.diagnosis.verdict.event_windows import Seen, _against_motion, joined, train_of
from hil.identification.measured import take

OWNER = bench()


def test_a_ramp_is_part_of_its_window_and_equal_neighbours_are_one() -> None:
    run = take(recorded(OWNER), OWNER)
    error = (1e-4, 1e-4, 0.1)
    ramp, push, other = (
        Seen(run, values, error) for values in ((1.0, 1.02, 20.0), (1.021, 1.8, 45.0), (1.8, 2.8, 30.0))
    )
    assert [one.values for one in joined([push, ramp, other])] == [(1.0, 1.8, 45.0), (1.8, 2.8, 30.0)]
    equal = [replace(one, values=(*one.values[:2], 40.0)) for one in (push, other)]
    assert [one.values for one in joined(equal, alike=True)] == [(1.021, 2.8, 40.0)]
    apart = [push, replace(other, values=(1.9, 2.0, 45.0)), replace(other, values=(2.0, 2.1, -45.0))]
    assert joined(apart, alike=True) == apart


def test_an_edge_that_nothing_tells_contradicts_no_period() -> None:
    starts_s = 1.0 + 0.5 * np.arange(5)
    edges, errors = np.stack([starts_s, starts_s + 0.2], axis=1), np.full((5, 2), 1e-3)
    edges[2, 1], errors[2, 1] = edges[2, 1] - 0.1, 0.2
    found = train_of(edges, errors)
    assert found is not None
    train, own, told = found
    assert (train.start_s, train.period_s, train.width_s) == pytest.approx((1.0, 0.5, 0.2), abs=1e-4)
    assert own[2, 1] == pytest.approx(2.2, abs=1e-4)
    assert told[2, 1] < 1e-3
    errors[2, 1] = 1e-3
    assert train_of(edges, errors) is None


@pytest.mark.parametrize(
    ("strength_n", "ways", "against"),
    [(lambda way: -20.0 * way, 8, True), (lambda way: -20.0 * way, 4, False), (lambda _: -20.0, 8, False)],
    ids=["a drag", "few windows", "a push"],
)
def test_windows_against_the_motion_both_ways_are_a_drag(
    strength_n: Callable[[float], float], ways: int, against: bool
) -> None:
    """Windows of 20 ms between the reversals of a motion to and fro."""
    run = take(recorded(OWNER), OWNER)
    to_and_fro = replace(run, motor=np.sin(2.0 * np.pi * run.time_s / 0.4))
    middles = [(0.2 * number, -1.0 if number % 2 else 1.0) for number in range(1, ways + 1)]  # time, way
    seen = [Seen(to_and_fro, (at - 0.01, at + 0.01, strength_n(way)), (1e-3, 1e-3, 1.0)) for at, way in middles]
    assert _against_motion(seen) == against
    assert not _against_motion([replace(one, values=(*one.values[:2], -one.values[2])) for one in seen])
