"""Real-time conditions: taken, reported, given back; and refusals to arm."""

from __future__ import annotations

import gc
import mmap
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from bench_runs import MOVE, bench_with
from hypothesis import given
from hypothesis import strategies as st

from hil.loop import realtime
from hil.loop.disturbances import Disturbances
from hil.loop.realtime import (
    Jitter,
    NotArmed,
    check_punctual,
    machine_state,
    measure_jitter,
    real_time,
    report,
)
from hil.loop.run import run_profile


def test_conditions_are_given_back() -> None:
    before = (os.sched_getaffinity(0), os.sched_getscheduler(0), gc.isenabled())
    with real_time() as grants:
        assert not gc.isenabled()
        assert len({grant.setting for grant in grants}) == len(grants) == 6
        for grant in grants:  # granted and in force, or refused with a reason
            if grant.setting.startswith("core") and not grant.refused:
                assert len(os.sched_getaffinity(0)) == 1
            if grant.setting.startswith("SCHED_FIFO") and not grant.refused:
                assert os.sched_getscheduler(0) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    assert (os.sched_getaffinity(0), os.sched_getscheduler(0), gc.isenabled()) == before


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to take real-time priority and give the rights up")
def test_without_the_right_to_real_time_the_priority_is_still_given_back() -> None:
    """As a user with an rtprio limit and without CAP_SYS_NICE: the kernel then keeps reset-on-fork."""
    code = (
        "import os\n"
        "from hil.loop.realtime import real_time\n"
        "with real_time() as grants:\n"
        "    assert os.sched_getscheduler(0) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, grants\n"
        "    os.setgid(65534); os.setuid(65534)\n"
        "print(os.sched_getscheduler(0) == os.SCHED_OTHER | os.SCHED_RESET_ON_FORK)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.stdout, ran.stderr) == ("True\n", "")


def test_the_loop_takes_an_isolated_core_or_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    cores = {"isolated": {2, 3}, "online": {0, 1, 2, 3}}
    allowed = {0, 1}  # isolcpus= takes its cores out of the affinity of every process
    monkeypatch.setattr(realtime, "_cores", lambda kind: cores[kind])
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: allowed)
    assert realtime.loop_core() == 3
    allowed = {1}  # narrowed: taskset, CPUAffinity=
    assert realtime.loop_core() == 1
    allowed = {1, 2}
    assert realtime.loop_core() == 2
    cores["isolated"], allowed = set(), {0, 1, 2, 3}
    assert realtime.loop_core() == 3


def test_disturbances_are_those_of_the_span() -> None:
    before = Disturbances.now()
    untouched = mmap.mmap(-1, 64 * mmap.PAGESIZE)
    for page in range(64):
        untouched[page * mmap.PAGESIZE] = 1
    gc.collect()
    thread = threading.Event()
    other = threading.Thread(target=thread.wait)
    other.start()
    found = Disturbances.now().since(before)
    thread.set()
    other.join()
    assert found.page_faults > 0
    assert found.collections >= 1
    assert found.threads == before.threads + 1


def test_lists_of_cores_are_read() -> None:
    assert realtime._cores("online") >= os.sched_getaffinity(0)
    assert realtime._cores("no such list") == set()


def test_report_says_what_was_refused() -> None:
    with real_time() as grants:
        jitter = measure_jitter(0.001, 0.02)
    written = report(grants, jitter)
    assert len(written["granted"]) + len(written["refused"]) == 6
    assert all(written["refused"].values())
    assert written["jitter_before_arming"]["ticks"] == 20
    assert set(machine_state()) >= {"kernel", "preempt_rt", "governor", "cores"}


@given(st.lists(st.floats(0.0, 0.1), min_size=1, max_size=300))
def test_percentiles_are_nearest_ranks(lateness_s: list[float]) -> None:
    jitter = Jitter.of(lateness_s, 0.001)
    assert sum(late <= jitter.p50_s for late in lateness_s) >= 0.5 * len(lateness_s)
    assert sum(late <= jitter.p99_s for late in lateness_s) >= 0.99 * len(lateness_s)
    assert {jitter.p50_s, jitter.p99_s, jitter.max_s} <= set(lateness_s)
    assert jitter.max_s == max(lateness_s)
    assert jitter.missed == sum(late >= 0.001 for late in lateness_s)


def test_jitter_beyond_the_budget_is_refused() -> None:
    jitter = Jitter.of([0.0] * 90 + [0.0007] * 10, 0.001)
    check_punctual(jitter, 0.0008)
    with pytest.raises(NotArmed, match=r"p99 700 us.*allowed p99 500 us.*--force"):
        check_punctual(jitter, 0.0005)


def test_bus_load_beyond_the_budget_is_refused_or_overridden(tmp_path: Path) -> None:
    slow = bench_with(drive={"bitrate": 250_000})
    with pytest.raises(NotArmed, match=r"take 1\d\d % of the bus at 250000 bit/s"):
        run_profile(slow, MOVE, tmp_path, "run", virtual=True)
    assert list(tmp_path.iterdir()) == []
    ran = run_profile(slow, MOVE, tmp_path, "run", virtual=True, force=True)
    assert ran.complete
    assert "drive.bus_load" in ran.doubts[0]


def test_real_time_path_loads_neither_scipy_nor_plotting_nor_pyarrow() -> None:
    modules = "hil.loop.session, hil.loop.run, hil.recording.writer, hil.loop.realtime"
    # numba asks scipy for its version, which loads no more than the package's own frame
    names = "('scipy.linalg', 'scipy.optimize', 'scipy.signal', 'scipy.io', 'matplotlib', 'bokeh', 'pyarrow')"
    heavy = f"[name for name in {names} if name in sys.modules]"
    found = subprocess.run(
        [sys.executable, "-c", f"import sys, {modules}; print({heavy})"], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "[]"
