"""The process that keeps a writer at work: it starts one, and another one when that is killed, stopped or hangs.

It does not touch the disk, and changes nothing of the rows. While the axis moves it tells on standard error what the
user can mend: a disk without room, a disk that does not answer, a writer that had to be replaced.
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
SILENT_S = 2.0  # without a sign of life the user is told; a disk that syncs for longer is in trouble
HUNG_S = 10.0  # and the writer is replaced; the ring lasts longer
START_S = 30.0  # instead, before its first sign of life: importing pyarrow on a slow, loaded machine takes 20 s


class Keeper:
    """Keeps a writer at work on a ring."""

    def __init__(self, ring: Ring) -> None:
        self._ring, self._name = ring, Path(ring.task["path"]).name
        self._told = ""  # the trouble that was told last
        _end_orphan(ring[Counter.WRITER_PID])

    def keep(self) -> int:
        """Keep a writer at work until the recording is over. Returns the exit code of the last one."""
        while True:
            command = [sys.executable, "-P", "-m", "hil.recording.writer_process", str(self._ring.descriptor)]
            writer = subprocess.Popen(command, pass_fds=[self._ring.descriptor])
            self._ring[Counter.WRITER_PID] = writer.pid
            self._ring[Counter.WRITERS] += 1
            fate = self._watch(writer)
            if writer.returncode == 0:
                self._ring.remove()
            if writer.returncode >= 0:
                return writer.returncode
            row = self._ring[Counter.ON_DISK]
            self._say(f"its process {writer.pid} {fate or 'was killed'}; another one goes on at row {row}")

    def _watch(self, writer: subprocess.Popen[bytes]) -> str:
        """Wait for the end of a writer; kill it if it is stopped or hangs, and return which."""
        fate, beat, beat_s, limit_s = "", self._ring[Counter.BEAT], time.monotonic(), START_S
        while True:
            signal.sigtimedwait({signal.SIGCHLD}, WATCH_S)
            if end_if_stopped(writer):
                fate = "was stopped"
            if writer.returncode is not None:
                return fate
            ended = self._ring[Counter.END_BYTES] > 0  # then a Parquet file is made of it, which takes its time
            if self._ring[Counter.BEAT] != beat or ended:
                limit_s = HUNG_S
                beat, beat_s = self._ring[Counter.BEAT], time.monotonic()
            silent_s = time.monotonic() - beat_s
            if silent_s > limit_s and not _waits_for_disk(writer.pid):
                fate = "hung"
                writer.kill()
            self._tell_trouble("the disk does not answer" if silent_s > SILENT_S else "")

    def _tell_trouble(self, silence: str) -> None:
        """Tell the user why rows wait in memory, once for each reason, and when that is over."""
        trouble = self._ring.error or silence
        if trouble == self._told:
            return
        self._told = trouble
        waiting = self._ring[Counter.RECORDED] - self._ring[Counter.ON_DISK]
        memory = f"{waiting} rows wait in memory, which holds {self._ring.rows}"
        self._say(f"{trouble}; {memory}: make room, or mend the disk" if trouble else "rows are written again")

    def _say(self, text: str) -> None:
        with contextlib.suppress(OSError):  # a terminal that is closed
            print(f"recorder of {self._name}: {text}", file=sys.stderr, flush=True)


def end_if_stopped(child: subprocess.Popen[bytes]) -> bool:
    """Kill a child that is stopped, as by SIGSTOP, and return True; set the return code of one that has ended."""
    if child.returncode is not None:  # Popen.kill has seen its end: it looks before it sends the signal
        return False
    pid, status = os.waitpid(child.pid, os.WNOHANG | os.WUNTRACED)
    if pid and os.WIFSTOPPED(status):
        child.kill()
        return True
    if pid:
        child.returncode = os.waitstatus_to_exitcode(status)
    return False


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


def main() -> None:
    """Keep a writer on the ring whose descriptor is the argument; standard input ends when the loop does."""
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGABRT):  # as in the writer
        signal.signal(name, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCHLD})
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # not with the loop's priority
    os.sched_setaffinity(0, range(os.cpu_count() or 1))  # nor bound to its core
    os._exit(Keeper(Ring(int(sys.argv[1]))).keep())


if __name__ == "__main__":
    main()
