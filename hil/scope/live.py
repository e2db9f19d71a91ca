"""Find the ring of the run that goes on, and find it again when the bench is started anew."""

from __future__ import annotations

import os
import struct
import threading
import time
from contextlib import suppress
from pathlib import Path

from hil.recording.ring import FOLDER, PATTERN, Ring
from hil.scope.rows import RingRows

LOOK_S = 0.2  # how often a new run is looked for


class LiveRing:
    """The rows of the newest run on this computer whose loop lives; those of the last one until there is another.

    within: only runs that are recorded in this folder or below. It takes no lock and changes nothing: `hil recover` and
    a new run find what they would without it. The scope leaves the cores to which a loop is bound.
    """

    def __init__(self, within: Path | None = None) -> None:
        self._within = (within or Path("/")).resolve()
        self._rows: RingRows | None = None
        self._looked_s = float("-inf")
        self._cores = os.sched_getaffinity(0)
        self._lock = threading.Lock()

    def rows(self) -> RingRows | None:
        """Return the rows of the run; None before the first one."""
        with self._lock:  # every page asks, from threads of its own
            if time.monotonic() - self._looked_s >= LOOK_S:
                self._looked_s = time.monotonic()
                if self._rows is None or self._rows.ended:
                    self._look()
            return self._rows

    def _look(self) -> None:
        """Take up the newest run that goes on, if there is one."""
        living = []
        for path in FOLDER.glob(PATTERN):
            with suppress(OSError, ValueError):  # just removed; another file
                if Path(f"/proc/{owner_of(path)}").exists():
                    living.append((path.stat().st_ctime_ns, path))
        for _, path in sorted(living, reverse=True):
            with suppress(OSError, ValueError, KeyError, TypeError, struct.error):  # of another user; not complete yet
                descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
                try:
                    rows = RingRows(Ring(descriptor), owner_of(path))
                finally:
                    os.close(descriptor)  # the mapping stays
                if not rows.ended and rows.path.is_relative_to(self._within):
                    self._rows = rows
                    self._leave_cores(owner_of(path))
                    return

    def _leave_cores(self, pid: int) -> None:
        for thread in Path("/proc/self/task").iterdir():  # an affinity is that of one thread
            with suppress(OSError):
                os.sched_setaffinity(int(thread.name), self._cores - os.sched_getaffinity(pid) or self._cores)


def owner_of(path: Path) -> int:
    """Process id of the loop, which stands in the name of its ring. Raises ValueError for another name."""
    return int(path.name.removeprefix(PATTERN[:-1]).split("-")[0])
