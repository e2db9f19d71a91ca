"""Which ticks a loop left out, and which of them cyclictest would have left out too.

cyclictest wakes several times in a period, on the loop's core and with a higher priority; the loop never delays it.
Each of its late wake-ups is a time in which the core ran no real-time thread. A peer of the loop that was due in such a
time would have been woken at its end. The rule of leaving out is that of the loop: `clock.next_due`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.loop.clock import SKIP_FROM

_SPIKE = re.compile(r"Spike:\s*(\d+): TS:\s*(\d+)")
_SHIFTS_S = (-7.3, -3.1, -1.7, 1.3, 2.9, 5.9)  # pairs that are left at these shifts are there by chance


class Stalls(NamedTuple):
    """Times without a real-time thread on the core, in order. begin_s, end_s: of each, by the monotonic clock [s];
    resolution_s: interval of the wake-ups that found them: one may have begun earlier by that."""

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
        """How late a wake-up that was due at these times would have been [s]; 0 outside of the stalls."""
        if not self.end_s.size:
            return np.zeros_like(due_s)
        after = np.searchsorted(self.end_s, due_s, side="right")
        inside = after < self.end_s.size
        after = np.minimum(after, self.end_s.size - 1)
        inside &= self.begin_s[after] - self.resolution_s <= due_s
        late_s: FloatArray = np.where(inside, self.end_s[after] - due_s, 0.0)
        return late_s


class LeftOut(NamedTuple):
    """Ticks left out. loop, peer: their number, of the loop and of a peer with the same due times. loop_only: the ticks
    that the peer did not leave out within a period; peer_only: the number of those of the peer that the loop did not;
    by_chance: how many the loop would share with a peer whose stalls were at other times, mean of several shifts."""

    loop: int
    peer: int
    loop_only: tuple[int, ...]
    peer_only: int
    by_chance: float


def compare(lateness_s: Sequence[float], first_tick_s: float, period_s: float, stalls: Stalls) -> LeftOut:
    """Compare a loop with a peer. lateness_s: of each tick that was not left out, counted from the first one left out
    before it [s]; first_tick_s: time at which the first one was due, by the monotonic clock [s]."""
    loop, ticks = of_loop(lateness_s[1:], period_s)
    due_s: FloatArray = first_tick_s + np.arange(1, ticks + 1, dtype=np.float64) * period_s
    peer = of_peer(stalls.lateness_s(due_s), period_s)
    shared = [_shared(loop, of_peer(stalls.lateness_s(due_s + shift_s), period_s)) for shift_s in _SHIFTS_S]
    alone = tuple(sorted(1 + tick for tick in loop if not _near(tick, peer)))
    return LeftOut(len(loop), len(peer), alone, len(peer) - _shared(peer, loop), float(np.mean(shared)))


def blocks(ticks: Sequence[int]) -> list[tuple[int, int]]:
    """Return the first of each block of ticks without a gap, and its length; the longest block first."""
    found = list[tuple[int, int]]()
    for tick in ticks:
        if found and tick == sum(found[-1]):
            found[-1] = (found[-1][0], found[-1][1] + 1)
        else:
            found.append((tick, 1))
    return sorted(found, key=lambda block: -block[1])


def of_loop(lateness_s: Sequence[float], period_s: float) -> tuple[set[int], int]:
    """Ticks left out, and number of all ticks, from the lateness of those that were not left out [s]."""
    left_out, tick = set[int](), 0
    for late_s in lateness_s:
        skipped = int(late_s / period_s)
        left_out |= set(range(tick, tick + skipped))
        tick += skipped + 1
    return left_out, tick


def of_peer(lateness_s: FloatArray, period_s: float) -> set[int]:
    """Ticks left out by the rule of the loop, from the lateness with which each would be met [s]."""
    left_out, following = set[int](), 0
    for tick in np.flatnonzero(lateness_s > SKIP_FROM * period_s).tolist():
        if tick >= following:
            following = tick + math.ceil(lateness_s[tick] / period_s)
            left_out |= set(range(tick, following))
    return left_out


def _shared(ticks: Iterable[int], others: set[int]) -> int:
    return sum(_near(tick, others) for tick in ticks)


def _near(tick: int, others: set[int]) -> bool:
    """True for a tick that is among the others, or beside one of them."""
    return bool({tick - 1, tick, tick + 1} & others)
