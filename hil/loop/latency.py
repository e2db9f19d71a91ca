"""Measure how late this machine wakes the loop, beside cyclictest of rt-tests on the same core at the same time.

The loop's clock sleeps until `SPIN_S` before a tick and spins from there. Both are measured: how late the sleep
returns ("wake-up", comparable with cyclictest, which only sleeps), and how late the tick begins ("tick", what the axis
sees). cyclictest runs with the same priority half a period away, so that both meet the same disturbances and neither
waits for the other; stalls of the core longer than half a period reach both.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from hil.loop.clock import SPIN_S, WallClock
from hil.loop.disturbances import Disturbances
from hil.loop.realtime import PRIORITY, Grant, loop_core, real_time

HALF_DECADES = (1e-6, 2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1)
_HISTOGRAM_US = 1_000_000  # longest latency that cyclictest resolves
_LEAD_S = 0.3  # from the start of cyclictest to its first wake-up at a full second
# A busy process: arithmetic and copies of more memory than a core's cache holds.
_BUSY = "import os, sys; os.sched_setaffinity(0, {int(sys.argv[1])}); a = bytearray(1 << 24)\nwhile True: bytes(a)"


@dataclass(frozen=True)
class Latencies:
    """How often each latency occurred, by its size [s]; of those that cyclictest does not resolve the largest is
    known, the others count as the longest that it does."""

    counts: dict[float, int]

    @classmethod
    def of(cls, values_s: Iterable[float]) -> Latencies:
        """Count latencies [s], rounded to 0.1 us."""
        return cls(dict(Counter(round(float(value_s), 7) for value_s in values_s)))

    @property
    def total(self) -> int:
        """Number of wake-ups."""
        return sum(self.counts.values())

    def quantile(self, part: float) -> float:
        """Return the quantile by nearest rank [s]."""
        rank, seen = max(1, math.ceil(part * self.total)), 0
        for latency_s, count in sorted(self.counts.items()):
            seen += count
            if seen >= rank:
                return latency_s
        return 0.0

    @property
    def largest_s(self) -> float:
        """The largest latency [s]."""
        return max(self.counts, default=0.0)

    def missed(self, period_s: float) -> int:
        """Return the periods that passed without a cycle: a latency of 3.2 periods misses three."""
        return sum(count * int(latency_s / period_s) for latency_s, count in self.counts.items())

    def bins(self) -> list[int]:
        """Counts below each of HALF_DECADES, and above the last."""
        found = [0] * (len(HALF_DECADES) + 1)
        for latency_s, count in self.counts.items():
            found[sum(latency_s >= edge for edge in HALF_DECADES)] += count
        return found


class Series(NamedTuple):
    """Latencies at one period. reference: those of cyclictest, None without it; why_not: the reason.
    disturbances: in the loop."""

    period_s: float
    tick: Latencies
    wake_up: Latencies
    reference: Latencies | None
    why_not: str
    grants: tuple[Grant, ...]
    disturbances: Disturbances


def measure(period_s: float, seconds: float, core: int | None = None) -> Series:
    """Measure at one period for some seconds, under the conditions of the loop. core: None as the loop chooses."""
    core = loop_core() if core is None else core
    ticks = max(1, round(seconds / period_s))
    sleeping, spinning = WallClock(period_s, 0.0), WallClock(period_s)
    done = 0
    late_s, woke_s = array("d", bytes(8 * ticks)), array("d", bytes(8 * ticks))  # a list would take memory per tick
    with cyclictest(period_s, seconds, core) as reference, real_time(core) as grants:
        # full seconds are the phase of cyclictest; the loop is half a period away
        start_s = math.ceil(time.perf_counter() + _LEAD_S) + 1.0 + 0.5 * period_s
        time.sleep(max(0.0, start_s - 2.0 * SPIN_S - time.perf_counter()))
        _spin_until(start_s - SPIN_S)
        sleeping.start()
        _spin_until(start_s)
        spinning.start()
        before = Disturbances.now()
        tick = 1
        while tick <= ticks:
            woke_s[done] = sleeping.wait(tick)
            late_s[done] = spinning.wait(tick)
            tick += 1 + int(late_s[done] / period_s)  # periods that have passed are skipped, as cyclictest does
            done += 1
        disturbances = Disturbances.now().since(before)
    found, why_not = reference()
    return Series(
        period_s, Latencies.of(late_s[:done]), Latencies.of(woke_s[:done]), found, why_not, grants, disturbances
    )


@contextmanager
def load() -> Iterator[int]:
    """Run a busy process on every core that this one may use, with ordinary priority; yields their number."""
    cores = sorted(os.sched_getaffinity(0) | {loop_core()})
    busy = [subprocess.Popen([sys.executable, "-c", _BUSY, str(core)]) for core in cores]
    try:
        yield len(busy)
    finally:
        for process in busy:
            process.kill()
            process.wait()


class Cyclictest:
    """Result of a run of cyclictest, when it has ended."""

    def __init__(self, process: subprocess.Popen[str] | None, results: Path) -> None:
        self._process, self._results = process, results
        self.found: tuple[Latencies | None, str] = (
            None,
            "cyclictest is not installed: sudo apt install rt-tests (Debian, Ubuntu), "
            "sudo dnf install realtime-tests (Fedora, RHEL)",
        )

    def __call__(self) -> tuple[Latencies | None, str]:
        return self.found

    def finish(self) -> None:
        """Wait for the end and read the histogram."""
        if self._process is None:
            return
        _, errors = self._process.communicate()
        try:
            thread = json.loads(self._results.read_text())["thread"]["0"]
            counts = {int(us) / 1e6: count for us, count in thread["histogram"].items()}
            if beyond := thread["cycles"] - sum(counts.values()):
                counts[max(thread["max"], _HISTOGRAM_US + 1) / 1e6] = 1
                if beyond > 1:
                    counts[_HISTOGRAM_US / 1e6] = beyond - 1
            self.found = Latencies(counts), ""
        except (OSError, ValueError, KeyError):
            self.found = None, f"cyclictest failed: {' '.join(errors.split()) or 'without a message'}"


@contextmanager
def cyclictest(period_s: float, seconds: float, core: int) -> Iterator[Cyclictest]:
    """Run cyclictest beside the block, if it is installed; its result is known after the block."""
    program = shutil.which("cyclictest")
    with tempfile.TemporaryDirectory(prefix="hil-latency-") as folder:
        results = Path(folder) / "cyclictest.json"
        process = None
        if program is not None:
            process = subprocess.Popen(
                [program, "--quiet", "--mlockall", f"--priority={PRIORITY}", f"--affinity={core}", "--secaligned",
                 f"--interval={round(1e6 * period_s)}", f"--loops={max(1, round(seconds / period_s))}",
                 f"--histogram={_HISTOGRAM_US}", f"--histfile={os.devnull}", f"--json={results}"],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
        reference = Cyclictest(process, results)
        try:
            yield reference
            reference.finish()
        finally:
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()


def _spin_until(time_s: float) -> None:
    while time.perf_counter() < time_s:
        pass
