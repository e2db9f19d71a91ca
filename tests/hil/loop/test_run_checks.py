"""Checks before the drive is armed, each at its bound; the causes that stop a run."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bench_runs import MOVE, bench_with

from drivers.cia402 import DriveState
from hil.bench.hardware import DriveSection
from hil.errors import FieldError, HilError
from hil.loop.devices import Rig
from hil.loop.realtime import NotArmed
from hil.loop.run import _check_bus_load, _check_missed, _check_set_points, _interruptible, _refused, run_profile


def trajectory(low_m: float, high_m: float, peak: float) -> Any:
    motion = np.array([0.0, -peak, peak / 2])
    return SimpleNamespace(position_m=np.array([low_m, high_m]), velocity_m_s=motion, acceleration_m_s2=motion,
                           jerk_m_s3=motion)  # fmt: skip


@pytest.mark.parametrize(("low_m", "high_m", "allowed"), [
    (-0.1, 0.3, True), (-0.05, 0.2, True), (-0.1001, 0.2, False), (0.0, 0.3001, False),
])  # fmt: skip
def test_set_points_stay_within_the_travel(low_m: float, high_m: float, allowed: bool) -> None:
    section = DriveSection(travel_m=(-0.1, 0.3))
    _check_set_points(trajectory(low_m, high_m, 0.0), DriveSection())
    if allowed:
        _check_set_points(trajectory(low_m, high_m, 0.0), section)
        return
    with pytest.raises(FieldError, match=rf"from {low_m:g} to {high_m:g} m, allowed -0.1 to 0.3 m"):
        _check_set_points(trajectory(low_m, high_m, 0.0), section)


@pytest.mark.parametrize("name", ["velocity_m_s", "acceleration_m_s2", "jerk_m_s3"])
def test_set_points_stay_within_each_limit(name: str) -> None:
    limits = {"velocity_m_s": 9.0, "acceleration_m_s2": 9.0, "jerk_m_s3": 9.0, name: 2.0}
    section = DriveSection(limits=limits)
    _check_set_points(trajectory(0.0, 0.1, 2.0), section)
    with pytest.raises(FieldError, match=rf"limits.{name}: given set-points up to 2.001, allowed 2"):
        _check_set_points(trajectory(0.0, 0.1, 2.001), section)


@pytest.mark.parametrize(("load", "allowed"), [(0.7, True), (0.0, True), (0.701, False), (1.5, False)])
def test_the_bus_may_be_as_full_as_the_bench_says(load: float, allowed: bool) -> None:
    rig: Any = SimpleNamespace(bus_load=lambda: load)
    if allowed:
        _check_bus_load(rig, DriveSection())
        return
    with pytest.raises(NotArmed, match=rf"take {100 * load:.0f} % of the bus at 1000000 bit/s, allowed 70 %"):
        _check_bus_load(rig, DriveSection())


def test_a_refusal_is_told_or_overridden() -> None:
    watches: Any = SimpleNamespace(misses_this_pc=lambda: True)
    does_not: Any = SimpleNamespace(misses_this_pc=lambda: False)
    assert _refused(False, lambda: _check_missed(watches)) == ""
    with pytest.raises(NotArmed, match="it does not watch it"):
        _refused(False, lambda: _check_missed(does_not))
    told = _refused(True, lambda: _check_missed(does_not))
    assert told.endswith("it does not watch it; the drive was armed all the same, as --force or drive.over_budget asks")


def test_a_fault_is_reset_only_if_that_is_asked_for(tmp_path: Path) -> None:
    with Rig(bench_with()) as rig:
        rig.nodes.drive._set_state(DriveState.FAULT)
        with pytest.raises(HilError, match="tripped: FAULT"):
            run_profile(rig.bench, MOVE, tmp_path, "run", virtual=True, rig=rig)
        assert rig.nodes.drive.state is DriveState.FAULT
        assert run_profile(rig.bench, MOVE, tmp_path, "run", virtual=True, rig=rig, reset_fault=True).complete


class Asked:
    """A session that counts requests to stop."""

    count = 0

    def ask_stop(self) -> None:
        self.count += 1


def test_signals_stop_the_axis_and_are_given_back() -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    given = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ignored under nohup
    before = {number: signal.getsignal(number) for number in numbers}
    session: Any = Asked()
    with _interruptible(session):
        for number in (*numbers, signal.SIGHUP):  # the second hang-up is the shell's
            os.kill(os.getpid(), number)
        assert session.count == 3
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    signal.signal(signal.SIGHUP, before[signal.SIGHUP])
    assert {number: signal.getsignal(number) for number in numbers} == before
    signal.signal(signal.SIGHUP, given)


def test_a_hang_up_that_is_ignored_stays_so() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    session: Any = Asked()
    with _interruptible(session):
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    signal.signal(signal.SIGHUP, before)


def test_another_thread_takes_no_signals() -> None:
    seen: list[Any] = []

    def run() -> None:
        with _interruptible(Asked()):  # type: ignore[arg-type]
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGINT)]
