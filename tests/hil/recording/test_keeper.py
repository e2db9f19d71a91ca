"""The keeper of the writer: ends of a writer that it may meet."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from hil.recording.keeper import end_if_stopped

_SLEEP = [sys.executable, "-c", "import time; time.sleep(60)"]


@pytest.fixture
def child() -> subprocess.Popen[bytes]:
    return subprocess.Popen(_SLEEP)


def test_a_hung_writer_that_dies_slowly_is_killed_twice(child: subprocess.Popen[bytes]) -> None:
    child.kill()
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)  # dead, and not yet asked for
    child.kill()  # Popen asks for its end before it sends the signal
    assert not end_if_stopped(child)
    assert child.returncode == -signal.SIGKILL


def test_a_stopped_writer_is_killed(child: subprocess.Popen[bytes]) -> None:
    child.send_signal(signal.SIGSTOP)
    os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOWAIT)
    assert end_if_stopped(child)
    assert child.wait() == -signal.SIGKILL
