"""Ticks come at start + tick x period."""

from __future__ import annotations

import time

import pytest

from hil.loop import clock as clock_module
from hil.loop.clock import LatenessLog, VirtualClock, WallClock


def test_no_tick_comes_early_and_lateness_does_not_add_up() -> None:
    clock = WallClock(0.002)
    start_s = time.perf_counter()  # before the clock's own start
    clock.start()
    for tick in range(1, 50):
        late_s = clock.wait(tick)
        assert late_s >= 0.0
        assert time.perf_counter() - start_s >= tick * 0.002


class SlowToWake:
    """Time of a machine that wakes 50 us after the end of a sleep; reading it takes 1 us."""

    def __init__(self) -> None:
        self.now_ns = 0

    def perf_counter_ns(self) -> int:
        self.now_ns += 1_000
        return self.now_ns

    def sleep(self, span_s: float) -> None:
        assert span_s > 0.0
        self.now_ns += round(span_s * 1e9) + 50_000


@pytest.mark.parametrize(("spin_s", "late_s"), [(0.0, 50e-6), (100e-6, 0.0), (20e-6, 30e-6)])
def test_a_late_wake_up_within_the_spun_time_is_no_late_tick(
    monkeypatch: pytest.MonkeyPatch, spin_s: float, late_s: float
) -> None:
    monkeypatch.setattr(clock_module, "time", SlowToWake())
    clock = WallClock(0.002, spin_s)
    clock.start()
    for tick in range(1, 50):
        assert 0.0 <= clock.wait(tick) - late_s <= 2e-6


def test_a_late_tick_keeps_the_deadlines_of_those_after_it() -> None:
    clock = WallClock(0.005)
    clock.start()
    time.sleep(0.012)
    assert clock.wait(1) >= 0.007
    assert clock.wait(2) >= 0.002
    assert clock.since(2) >= 0.002
    assert clock.wait(100) < 100 * 0.005  # from the start, not from the late tick


def test_waiting_within_a_tick_ends() -> None:
    clock = WallClock(0.001)
    clock.start()
    assert clock.may_wait(1000, 0.001)
    clock.wait(3)
    assert not clock.may_wait(1, 0.001)


def test_virtual_clock_is_always_on_time() -> None:
    clock = VirtualClock()
    clock.start()
    assert [clock.wait(tick) for tick in (1, 2, 1_000_000)] == [0.0, 0.0, 0.0]
    assert clock.since(5) == 0.0
    assert not clock.may_wait(5, 10.0)


def test_lateness_is_kept_in_memory_that_does_not_grow() -> None:
    log = LatenessLog(5)
    for late_s in (0.1, 0.2, 0.3):
        log.add(late_s)
    assert list(log.values) == [0.1, 0.2, 0.3]
    log.begin()
    assert list(log.values) == [0.3]
    log.add(0.4)
    log.begin(2)
    assert list(log.values) == [0.4, 0.0, 0.0]
    assert log.last_s == 0.0
    for late_s in (0.5, 0.6, 0.7):
        log.add(late_s)
    assert list(log.values) == [0.4, 0.0, 0.0, 0.5, 0.6]
    assert log.last_s == 0.7
