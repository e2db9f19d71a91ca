"""The process that keeps a writer at work: it starts one, and another one when that is killed, stopped or hangs.

It does not touch the disk, and changes nothing of the rows. While the axis moves it tells on standard error what the
user can mend: a writer that had to be replaced, a disk without room.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from hil.recording.ring import Counter, Ring

WATCH_S = 0.05  # how often the writer is looked at; its end is told by the kernel at once
HUNG_S = 10.0  # without a sign of life; a start of pyarrow on a loaded machine takes seconds, the ring lasts a minute


def keep(ring: Ring) -> int:
    """Keep a writer at work until the recording is over. Returns the exit code of the last one."""
    name, error = Path(ring.task["path"]).name, ""
    _end_orphan(ring[Counter.WRITER_PID])
    while True:
        writer = subprocess.Popen(
            [sys.executable, "-P", "-m", "hil.recording.writer_process", str(ring.descriptor)],
            pass_fds=[ring.descriptor],
        )
        ring[Counter.WRITER_PID] = writer.pid
        ring[Counter.WRITERS] += 1
        beat, beat_s = ring[Counter.BEAT], time.monotonic()
        fate = ""
        while True:
            signal.sigtimedwait({signal.SIGCHLD}, WATCH_S)
            pid, status = os.waitpid(writer.pid, os.WNOHANG | os.WUNTRACED)
            if pid and not os.WIFSTOPPED(status):
                writer.returncode = os.waitstatus_to_exitcode(status)
                break
            if ring[Counter.BEAT] != beat:
                beat, beat_s = ring[Counter.BEAT], time.monotonic()
            hung = time.monotonic() - beat_s > HUNG_S and not _waits_for_disk(writer.pid)
            if pid or hung:
                fate = "was stopped" if pid else "hung"
                os.kill(writer.pid, signal.SIGKILL)
            if ring.error != error:
                error = ring.error
                rows = ring[Counter.RECORDED] - ring[Counter.ON_DISK]
                _tell(f"{error}; {rows} rows wait in memory, which holds {ring.rows}: make room" if error
                      else "the rows are written again", name)  # fmt: skip
        if writer.returncode == 0:
            ring.remove()
        if writer.returncode >= 0:
            return writer.returncode
        _tell(f"its process {writer.pid} {fate or 'was killed'}; another one goes on at row {ring[Counter.ON_DISK]}",
              name)  # fmt: skip


def _end_orphan(pid: int) -> None:
    """Kill the writer of a keeper that was killed."""
    with contextlib.suppress(OSError):
        if pid and b"hil.recording.writer_process" in Path(f"/proc/{pid}/cmdline").read_bytes():
            os.kill(pid, signal.SIGKILL)


def _waits_for_disk(pid: int) -> bool:
    """Return True in uninterruptible sleep (proc(5): state D), which another writer would only share."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "D"
    except OSError:
        return False


def _tell(text: str, name: str) -> None:
    with contextlib.suppress(OSError):  # a terminal that is closed
        print(f"recorder of {name}: {text}", file=sys.stderr, flush=True)


def main() -> None:
    """Keep the ring whose descriptor is the argument; standard input ends when the loop does."""
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT):  # as in the writer
        signal.signal(name, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCHLD})
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # not with the loop's priority
    os.sched_setaffinity(0, range(os.cpu_count() or 1))  # nor bound to its core
    os._exit(keep(Ring(int(sys.argv[1]))))


if __name__ == "__main__":
    main()
