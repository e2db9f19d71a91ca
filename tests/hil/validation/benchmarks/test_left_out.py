"""Ticks that the loop and cyclictest left out: read, counted by one rule, compared."""

from __future__ import annotations

import numpy as np
import pytest

from hil.arrays import FloatArray
from hil.loop.clock import VirtualClock, next_due
from hil.validation.benchmarks.left_out import Stalls, compare, of_loop, of_peer

PERIOD_S = 0.001
# what `cyclictest --spike=125` prints after its histogram: latency and end of two stalls
SPIKES = """T: 0 Spike:    1900: TS:  5010900
T: 0 Spike:     700: TS:  5003700
spikes = 2
"""


class Stalled(VirtualClock):
    """A clock whose loop is not run during stalls, and takes no time otherwise."""

    def __init__(self, stalls: Stalls, first_s: float) -> None:
        self._stalls, self._first_s = stalls, first_s

    def wait(self, tick: int) -> float:
        return float(self._stalls.lateness_s(np.array([self._first_s + tick * PERIOD_S]))[0])


def loop(stalls: Stalls, ticks: int, first_s: float) -> list[float]:
    """Lateness of the ticks of a loop that are not left out [s]."""
    clock, tick, lateness_s = Stalled(stalls, first_s), 0, list[float]()
    while tick < ticks:
        due = next_due(clock, tick, PERIOD_S, clock.wait(tick))
        lateness_s.append(due.lateness_s)
        tick = due.tick + 1
    return lateness_s


def stalls_of(begin_s: FloatArray, length_s: FloatArray) -> Stalls:
    return Stalls(begin_s, begin_s + length_s, 0.0)


def test_late_wake_ups_are_read_with_their_times() -> None:
    stalls = Stalls.of(SPIKES, 0.00025)
    assert stalls.end_s == pytest.approx([5.0037, 5.0109])
    assert stalls.begin_s == pytest.approx([5.003, 5.009])
    due_s = np.array([5.0027, 5.0028, 5.0032, 5.0038, 5.0100, 5.02])
    assert stalls.lateness_s(due_s) == pytest.approx([0.0, 0.0009, 0.0005, 0.0, 0.0009, 0.0])
    assert not Stalls.of("spikes = 0", 0.00025).lateness_s(due_s).any()


@pytest.mark.parametrize("seed", range(5))
def test_a_loop_in_the_same_stalls_leaves_out_the_same_ticks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    begin_s = 100.0 + np.cumsum(rng.uniform(0.015, 0.03, 50))
    stalls = stalls_of(begin_s, rng.choice([0.0003, 0.0008, 0.0021, 0.0097], 50))
    lateness_s = loop(stalls, 1500, 100.0)
    left_out, ticks = of_loop(lateness_s, PERIOD_S)
    assert left_out == of_peer(stalls.lateness_s(100.0 + np.arange(ticks) * PERIOD_S), PERIOD_S)
    found = compare(lateness_s, 100.0, PERIOD_S, stalls)
    assert (found.loop, found.peer) == (len(left_out), len(left_out))
    assert (found.loop_only, found.peer_only) == (0, 0)


def test_ticks_of_one_side_alone_are_counted_on_that_side() -> None:
    stalls = stalls_of(np.array([100.0495, 100.2998]), np.array([0.003, 0.0018]))
    other = stalls_of(np.array([100.0495, 100.6998]), np.array([0.003, 0.0048]))
    found = compare(loop(stalls, 1000, 100.0), 100.0, PERIOD_S, other)
    assert found == (3 + 2, 3 + 5, 2, 5)
