"""The sd_notify protocol over real sockets; the watchdog is fed while ticks advance, and only then."""

from __future__ import annotations

import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from bench_runs import MOVE
from patient_bench import patient_bench
from processes import DEADLINE_S, is_over, wait_for

from hil.loop.notify import FEEDS, Notifier, NotifyingClock
from hil.loop.run import run_profile
from hil.recording.recording import read_recording


class Manager:
    """What systemd does: a datagram socket that takes states; address as it stands in NOTIFY_SOCKET."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self.socket.setblocking(False)

    def received(self) -> list[list[str]]:
        """States of each datagram since the last call."""
        datagrams = []
        while select.select([self.socket], [], [], 0)[0]:
            datagrams.append(self.socket.recv(4096).decode().split("\n"))
        return datagrams


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Manager]:
    manager = Manager(str(tmp_path / "notify") if request.param == "path" else f"@hil-test-{os.getpid()}")
    yield manager
    manager.socket.close()


def test_states_arrive_as_one_datagram(manager: Manager) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": manager.address})
    notifier.send("READY=1", "STATUS=two\nlines")
    assert manager.received() == [["READY=1", "STATUS=two lines"]]
    notifier.close()
    notifier.send("READY=1")
    assert manager.received() == []


@pytest.mark.parametrize("address", ["", "relative", "vsock:2:1", "/nobody/listens/here"])
def test_no_manager_is_no_error(address: str) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": address})
    notifier.send("READY=1")
    notifier.close()


def test_a_manager_that_does_not_read_never_blocks_the_loop(manager: Manager) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": manager.address})
    for _ in range(100_000):  # far beyond any queue of datagrams; a blocking socket would stop here for good
        notifier.send("WATCHDOG=1")
    notifier.close()
    assert 0 < len(manager.received()) < 100_000


@pytest.mark.parametrize(
    ("environ", "seconds"),
    [
        ({"WATCHDOG_USEC": "2000000"}, 2.0),
        ({"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid())}, 2.0),
        *(({"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": pid}, 0.0) for pid in ("1", "0", "99999999")),  # of another
        ({"WATCHDOG_USEC": "soon"}, 0.0),
        ({}, 0.0),
    ],
)
def test_the_watchdog_is_the_one_of_this_process(environ: dict[str, str], seconds: float) -> None:
    assert Notifier(environ).watchdog_s == seconds


def test_the_watchdog_is_fed_only_while_ticks_advance(manager: Manager) -> None:
    watchdog_s, period_s = 0.04, 0.001
    notifier = Notifier({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": str(round(watchdog_s * 1e6))})
    clock = NotifyingClock(period_s, notifier)
    clock.start()
    assert manager.received() == [["READY=1", "WATCHDOG=1", "STATUS=the loop runs"]]
    for tick in range(1, 101):
        clock.wait(tick)
    fed = manager.received()
    assert len(fed) == 100 * period_s / (watchdog_s / FEEDS)
    assert all(states[0] == "WATCHDOG=1" for states in fed)
    for _ in range(1000):  # a loop that waits for the same tick again and again
        clock.wait(100)
    time.sleep(2 * watchdog_s)  # or hangs
    assert manager.received() == []
    clock.wait(110)
    assert len(manager.received()) == 1
    notifier.close()


@pytest.mark.parametrize(("watchdog_us", "fed"), [("2000", 6), ("8000", 3), ("12000", 2)])
def test_the_watchdog_is_fed_four_times_or_with_each_tick(manager: Manager, watchdog_us: str, fed: int) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": watchdog_us})
    clock = NotifyingClock(0.001, notifier)
    clock.start()
    for tick in range(1, 7):
        clock.wait(tick)
    assert len(manager.received()) == 1 + fed
    notifier.close()


def test_without_a_watchdog_the_status_is_renewed_every_ten_seconds(manager: Manager) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": manager.address})
    clock = NotifyingClock(1.0, notifier)
    clock.start()
    clock._start_ns -= 10**12  # as if the ticks had been waited for
    manager.received()
    for tick in range(1, 21):
        clock.wait(tick)
    assert [states[1][-13:] for states in manager.received()] == ["tick 10, 10 s", "tick 20, 20 s"]
    notifier.close()


def test_a_run_tells_its_phases(manager: Manager, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", manager.address)
    monkeypatch.setenv("WATCHDOG_USEC", "400000")
    ran = run_profile(patient_bench(), MOVE, tmp_path, "run", force=True)
    told = manager.received()
    assert [states[0] for states in told[:1] + told[-1:]] == ["READY=1", "STOPPING=1"]
    assert told[-1][1].startswith(f"STATUS={ran.outcome.ending}")
    assert told[-1][2:] == ["WATCHDOG_USEC=30000000", "WATCHDOG=1"]  # the recording may take longer than a tick
    assert {states[0] for states in told[1:-1]} == {"WATCHDOG=1"}


def test_the_signal_of_the_watchdog_leaves_the_rows_of_the_ring_readable(tmp_path: Path) -> None:
    """SIGABRT to loop and writer, as systemd sends it to a service: the loop ends at once, the writer completes."""
    code = f"""
import os, signal
from hil.recording.writer import Recorder
recorder = Recorder({str(tmp_path)!r}, "run", ["time_s", "motor_position_rad", "torque_n_m"], 0.001, {{}})
for tick in range(1000):
    recorder.record((tick * 0.001, 0.0, 1.0))
print(recorder.writer_pid, flush=True)
os.kill(recorder.writer_pid, signal.SIGABRT)
os.kill(os.getpid(), signal.SIGABRT)
"""
    killed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=DEADLINE_S
    )
    assert killed.returncode == -6
    wait_for(lambda: is_over(int(killed.stdout)))
    assert len(read_recording(tmp_path / "run.arrows")["time_s"]) == 1000
