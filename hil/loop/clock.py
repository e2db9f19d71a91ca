"""Clocks of the loop: the wall clock with absolute deadlines, and a virtual one that is always on time.

Tick k is due at start + k x period, never at now + period: an error of one tick is not handed on to the next. A tick
that comes too late is left out, as are all that were due meanwhile: set-points sent in a burst would be steps.
"""

from __future__ import annotations

import math
import time
from array import array
from typing import NamedTuple, Protocol

SKIP_FROM = 0.5  # lateness in periods: two SYNCs are never closer than half a period
SPIN_S = 100e-6  # sleep up to here before the deadline, then spin: waking takes some 50 us


class Clock(Protocol):
    """Times of the ticks of a loop."""

    def start(self) -> None:
        """Tick 0 is due now."""

    def wait(self, tick: int) -> float:
        """Return when the tick is due; how late that is [s]."""

    def since(self, tick: int) -> float:
        """Time since the tick was due [s]."""

    def may_wait(self, tick: int, span_s: float) -> bool:
        """Return True until `span_s` after the tick was due; waiting for late answers is allowed."""


class WallClock:
    """Real time. Sleeps up to `spin_s` before a deadline, then spins; spinning all the time would have the kernel
    throttle a real-time thread. A `spin_s` of 0 only sleeps."""

    def __init__(self, period_s: float, spin_s: float = SPIN_S) -> None:
        self._period_ns = round(period_s * 1e9)
        self._spin_ns = round(spin_s * 1e9)
        self._start_ns = 0

    def start(self) -> None:
        self._start_ns = time.perf_counter_ns()

    def wait(self, tick: int) -> float:
        deadline_ns = self._start_ns + tick * self._period_ns
        now_ns = time.perf_counter_ns()
        if now_ns < deadline_ns - self._spin_ns:
            time.sleep((deadline_ns - self._spin_ns - now_ns) * 1e-9)
            now_ns = time.perf_counter_ns()
        while now_ns < deadline_ns:
            now_ns = time.perf_counter_ns()
        return (now_ns - deadline_ns) * 1e-9

    def since(self, tick: int) -> float:
        return (time.perf_counter_ns() - self._start_ns - tick * self._period_ns) * 1e-9

    def may_wait(self, tick: int, span_s: float) -> bool:
        return self.since(tick) < span_s


class VirtualClock:
    """Time that passes as fast as the machine allows: every tick is on time and takes none."""

    def start(self) -> None:
        """Do nothing."""

    def wait(self, tick: int) -> float:
        return 0.0

    def since(self, tick: int) -> float:
        return 0.0

    def may_wait(self, tick: int, span_s: float) -> bool:
        return False


class LatenessLog:
    """Lateness of the ticks of a run [s], in memory that is there before the loop begins: growing costs page faults."""

    def __init__(self, capacity: int) -> None:
        self._values = array("d", bytes(8 * capacity))
        self.ticks = 0
        self.last_s = 0.0

    def add(self, late_s: float) -> None:
        """Take the lateness of a tick; ticks beyond the capacity are not kept."""
        self.last_s = late_s
        if self.ticks < len(self._values):
            self._values[self.ticks] = late_s
            self.ticks += 1

    def begin(self, punctual: int = 0) -> None:
        """Forget all ticks but the last one; after it came as many that were in time."""
        self._values[0] = self.last_s
        self._values[1 : 1 + punctual] = array("d", bytes(8 * punctual))
        self.ticks = 1 + punctual
        self.last_s = 0.0 if punctual else self.last_s

    @property
    def values(self) -> array[float]:
        """Lateness of each tick."""
        return self._values[: self.ticks]


class DueTick(NamedTuple):
    """A tick that is due now, its lateness, counted from the first one left out [s], and how many were left out."""

    tick: int
    lateness_s: float
    skipped: int


def next_due(clock: Clock, tick: int, period_s: float, late_s: float, limit_s: float = math.inf) -> DueTick:
    """Wait for the first tick after `tick`, which came late_s too late, that is met within SKIP_FROM periods.

    From limit_s after `tick` on the next one is taken, however late: the loop must act.
    """
    first = tick
    while late_s > SKIP_FROM * period_s and (tick - first) * period_s <= limit_s:
        tick += math.ceil(late_s / period_s)
        late_s = clock.wait(tick)
    return DueTick(tick, (tick - first) * period_s + late_s, tick - first)
