"""Ticks that a loop left out, and those that cyclictest would have left out too.

cyclictest wakes several times in a period, on the loop's core and with a higher priority; the loop never delays it.
Each of its late wake-ups is a time in which the core ran no real-time thread. A peer of the loop that was due in such a
time would have been woken at its end. The rule of leaving out is that of the loop: `clock.next_due`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.loop.clock import SKIP_FROM

_SPIKE = re.compile(r"Spike:\s*(\d+): TS:\s*(\d+)")


class Stalls(NamedTuple):
    """Times without a real-time thread on the core, in order: begin and end by the monotonic clock [s].

    resolution_s: interval of the wake-ups that found them; a stall may have begun earlier by that.
    """

    begin_s: FloatArray
    end_s: FloatArray
    resolution_s: float

    @classmethod
    def of(cls, text: str, resolution_s: float) -> Stalls:
        """Read what `cyclictest --spike` prints: latency and time of each late wake-up [us]."""
        found = np.array([(float(late), float(time)) for late, time in _SPIKE.findall(text)]).reshape(-1, 2) * 1e-6
        found = found[np.argsort(found[:, 1])]
        return cls(found[:, 1] - found[:, 0], found[:, 1], resolution_s)

    def lateness_s(self, due_s: FloatArray) -> FloatArray:
        """Return how late a wake-up that was due at these times would have been [s]; 0 outside of the stalls."""
        end_s = np.append(self.end_s, np.inf)
        begin_s = np.append(self.begin_s, np.inf)
        after = np.searchsorted(self.end_s, due_s, side="right")
        late_s: FloatArray = np.where(begin_s[after] - self.resolution_s <= due_s, end_s[after] - due_s, 0.0)
        return late_s


class LeftOut(NamedTuple):
    """Number of ticks left out by the loop and by a peer with the same due times, and of those left out by one and not
    by the other within a period."""

    loop: int
    peer: int
    loop_only: int
    peer_only: int


def compare(lateness_s: Sequence[float], first_tick_s: float, period_s: float, stalls: Stalls) -> LeftOut:
    """Compare a loop with a peer.

    lateness_s: of each tick that was not left out, counted from the first one left out before it [s]. first_tick_s:
    time at which the first one was due, by the monotonic clock [s].
    """
    loop, ticks = of_loop(lateness_s[1:], period_s)
    due_s: FloatArray = first_tick_s + np.arange(1, ticks + 1, dtype=np.float64) * period_s
    peer = of_peer(stalls.lateness_s(due_s), period_s)
    return LeftOut(len(loop), len(peer), _alone(loop, peer), _alone(peer, loop))


def of_loop(lateness_s: Sequence[float], period_s: float) -> tuple[set[int], int]:
    """Return the ticks left out and the number of all ticks, from the lateness of those that were not left out [s]."""
    left_out, tick = set[int](), 0
    for late_s in lateness_s:
        skipped = int(late_s / period_s)
        left_out |= set(range(tick, tick + skipped))
        tick += skipped + 1
    return left_out, tick


def of_peer(lateness_s: FloatArray, period_s: float) -> set[int]:
    """Return the ticks left out by the rule of the loop, from the lateness with which each would be met [s]."""
    left_out, following = set[int](), 0
    for tick in np.flatnonzero(lateness_s > SKIP_FROM * period_s).tolist():
        if tick >= following:
            following = tick + math.ceil(lateness_s[tick] / period_s)
            left_out |= set(range(tick, following))
    return left_out


def _alone(ticks: set[int], others: set[int]) -> int:
    return sum(not {tick - 1, tick, tick + 1} & others for tick in ticks)
