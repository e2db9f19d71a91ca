"""Request real-time conditions for this process, report the granted ones, and measure the jitter.

Linux and the standard library only. Each setting is optional: a refused one (mostly for missing rights) is reported
with its reason, and the loop runs without it.
"""

from __future__ import annotations

import ctypes
import gc
import math
import os
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hil.errors import HilError
from hil.loop.clock import WallClock

PRIORITY = 80  # SCHED_FIFO; the kernel's own interrupt threads run at 50
_MCL_CURRENT, _MCL_FUTURE = 1, 2  # linux/mman.h
_PR_SET_TIMERSLACK = 29  # linux/prctl.h
_WAKE_UP = Path("/dev/cpu_dma_latency")  # PM QoS: the longest time that an idle core may take to wake up, int32 us


class NotArmed(HilError):
    """The machine or the bus cannot keep the period, or the drive would not miss this PC. what: the finding alone."""

    def __init__(self, what: str, advice: str) -> None:
        super().__init__(f"{what}. The drive was not armed: {advice}, or arm all the same with --force")
        self.what = what


@dataclass(frozen=True)
class Grant:
    """A requested setting, and the reason of its refusal ("" if granted)."""

    setting: str
    refused: str = ""


@dataclass(frozen=True)
class Jitter:
    """Lateness of the ticks of a loop [s]."""

    ticks: int
    p50_s: float
    p99_s: float
    max_s: float
    missed: int  # a period or more late

    @classmethod
    def of(cls, lateness_s: Sequence[float], period_s: float) -> Jitter:
        """Compute from the lateness of each tick; nearest-rank percentiles."""
        ordered = sorted(lateness_s) or [0.0]

        def rank(part: float) -> float:
            return ordered[max(0, math.ceil(part * len(ordered)) - 1)]

        return cls(len(lateness_s), rank(0.5), rank(0.99), ordered[-1], sum(late >= period_s for late in ordered))

    @property
    def text(self) -> str:
        """Percentiles and missed ticks in one line."""
        return (
            f"p50 {1e6 * self.p50_s:.0f} us, p99 {1e6 * self.p99_s:.0f} us, largest {1e6 * self.max_s:.0f} us, "
            f"{self.missed} of {self.ticks} ticks missed"
        )


@contextmanager
def real_time(cpu: int | None = None, priority: int = PRIORITY) -> Iterator[tuple[Grant, ...]]:
    """Request real-time conditions; yields the settings with their refusals, and restores the former ones at the end.

    cpu: the core to run on; None: `loop_core()`. Compile and allocate before entering: the garbage collector is off
    inside.
    """
    before = os.sched_getaffinity(0)
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    gc.collect()
    gc.freeze()
    gc.disable()
    core = loop_core() if cpu is None else cpu
    wake_up: list[int] = []  # the request holds as long as the file is open
    grants = (
        Grant("garbage collector off"),
        _try("no deep sleep of idle cores", lambda: wake_up.append(_request_short_wake_up())),
        _try("memory locked", _lock_memory),
        _try("timer slack 1 ns", lambda: _check(_libc().prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0))),
        _try(f"core {core}", lambda: os.sched_setaffinity(0, {core})),
        _try(
            f"SCHED_FIFO {priority}",
            lambda: os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority)),
        ),
    )
    try:
        yield grants
    finally:
        if not grants[-1].refused:
            _leave_fifo(policy, parameters)
        os.sched_setaffinity(0, before)
        for descriptor in wake_up:
            os.close(descriptor)
        _libc().prctl(_PR_SET_TIMERSLACK, 0, 0, 0, 0)  # 0: the default of the thread
        _libc().munlockall()
        gc.enable()
        gc.unfreeze()


def loop_core() -> int:
    """Return the core for the loop: an isolated one if there is any, else the last one that this process may use.

    Interrupts mostly go to the first cores. The kernel's `isolcpus=` takes its cores out of the affinity of every
    process, so that an isolated core is used only by a process that asks for it. A process whose affinity was
    narrowed (taskset, CPUAffinity= of its service) stays within it.
    """
    allowed = os.sched_getaffinity(0)
    isolated, online = _cores("isolated"), _cores("online")
    narrowed = bool((online - isolated) - allowed)
    return max(isolated & allowed or (set() if narrowed else isolated) or allowed)


def measure_jitter(period_s: float, duration_s: float = 0.5, clock: WallClock | None = None) -> Jitter:
    """Measure the lateness of the ticks of a loop without work."""
    clock = clock or WallClock(period_s)
    clock.start()
    return Jitter.of([clock.wait(tick) for tick in range(1, max(2, round(duration_s / period_s)) + 1)], period_s)


def machine_state() -> dict[str, Any]:
    """Read the settings that limit the punctuality of this machine: kernel, preemption, governor, throttling, cores."""

    def read(path: str) -> str:
        try:
            return Path(path).read_text().strip()
        except OSError:
            return "unknown"

    release = os.uname()
    return {
        "kernel": release.release,
        "preempt_rt": "PREEMPT_RT" in release.version or read("/sys/kernel/realtime") == "1",
        "governor": read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        "rt_runtime_us": read("/proc/sys/kernel/sched_rt_runtime_us"),
        "cores": len(os.sched_getaffinity(0)),
        "load_1_min": round(os.getloadavg()[0], 2),
    }


def check_punctual(jitter: Jitter, p99_limit_s: float) -> None:
    """Raise NotArmed when the p99 of the lateness exceeds what the bench allows."""
    if jitter.p99_s > p99_limit_s:
        raise NotArmed(
            f"drive.jitter_p99: the loop is late by {jitter.text}; allowed p99 {1e6 * p99_limit_s:.0f} us",
            "take load off the machine, give the rights for real-time scheduling (docs/service.md), raise the budget "
            "in the bench file",
        )


def report(grants: tuple[Grant, ...], jitter: Jitter) -> dict[str, Any]:
    """Return grants, jitter before arming and machine state for the metadata of a recording."""
    return {
        "granted": [grant.setting for grant in grants if not grant.refused],
        "refused": {grant.setting: grant.refused for grant in grants if grant.refused},
        "jitter_before_arming": asdict(jitter),
        "machine": machine_state(),
    }


def _try(setting: str, action: Callable[[], Any]) -> Grant:
    try:
        action()
    except OSError as error:
        return Grant(setting, error.strerror or str(error))
    return Grant(setting)


def _leave_fifo(policy: int, parameters: os.sched_param) -> None:
    """Restore the policy of before; without CAP_SYS_NICE the kernel keeps reset-on-fork set (sched_setscheduler(2))."""
    try:
        os.sched_setscheduler(0, policy, parameters)
    except PermissionError:
        os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, parameters)


def _request_short_wake_up() -> int:
    """Ask the power management for a wake-up time of 0 us, as cyclictest does; returns the file to keep open."""
    descriptor = os.open(_WAKE_UP, os.O_WRONLY | os.O_CLOEXEC)
    try:
        os.write(descriptor, struct.pack("=i", 0))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def core_list(text: str) -> set[int]:
    """Read a list of cores such as `0-2,5`."""
    spans = [part.split("-") for part in text.split(",") if part]
    return {core for span in spans for core in range(int(span[0]), int(span[-1]) + 1)}


def _cores(kind: str) -> set[int]:
    """Return the cores of the kernel's list `kind`: isolated or online."""
    try:
        return core_list(Path(f"/sys/devices/system/cpu/{kind}").read_text().strip())
    except OSError:
        return set()


def _lock_memory() -> None:
    _check(_libc().mlockall(_MCL_CURRENT | _MCL_FUTURE))


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _check(result: int) -> None:
    if result != 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def now_text() -> str:
    """Return the present local time in ISO 8601 with its offset from UTC."""
    return time.strftime("%Y-%m-%dT%H:%M:%S%z")
