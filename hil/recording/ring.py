"""Rows of a run in shared memory, with all that a writer must know to begin, to go on, or to end the recording.

    counters | error text | rows (ring_rows, columns) of float64 | task as JSON | end of the run as JSON

It is a file in memory (tmpfs), so that it outlives the loop and every writer: a writer that dies is replaced by one
that reads the same counters, and `hil.recording.recover` finds the ring of a run whose processes have all ended. Each
counter has one process that changes it. A lock on the file (flock(2)) is held as long as one of the processes lives.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import mmap
import os
import struct
from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, Self

from hil.errors import HilError

FOLDER = Path("/dev/shm")  # a tmpfs on every Linux; a file on a disk would let the loop wait for the disk
PATTERN = "hil-ring-*"
_COUNTER_BYTES, _ERROR_BYTES = 1024, 1024
ROWS_AT = _COUNTER_BYTES + _ERROR_BYTES


class Counter(IntEnum):
    """Places of the counters, in units of 8 bytes: 64 bytes apart where two processes change them at the same time."""

    RECORDED = 0  # loop: rows in the ring so far
    END_BYTES = 1  # loop: length of the end; 0: the run goes on
    ABANDONED = 2  # loop: the recording is given up, do not try again
    TASK_BYTES = 3  # loop
    RING_ROWS = 4  # loop
    COLUMNS = 5  # loop
    ON_DISK = 8  # writer: rows in the file
    FILE_BYTES = 9  # writer: end of the last whole block; changed after ON_DISK
    BEAT = 10  # writer: grows as long as it works
    READY = 11  # writer: 1 with a file that can be written
    ERROR_BYTES = 12  # writer: length of the error text; 0: no error
    FINISHED = 13  # writer: 1 with a Parquet file, 2 without a row
    WRITER_PID = 16  # keeper
    WRITERS = 17  # keeper: writers started so far


class Ring:
    """The shared memory of one recording, by its open file. `create` makes one, the constructor maps one: only to read
    where the file is open for reading only."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        with open(descriptor, "rb", closefd=False, buffering=0) as raw:
            counters = struct.unpack(f"={_COUNTER_BYTES // 8}q", os.pread(raw.fileno(), _COUNTER_BYTES, 0))
        self.rows, self.columns = counters[Counter.RING_ROWS], counters[Counter.COLUMNS]
        self._task_at = ROWS_AT + self.rows * self.columns * 8
        writes = fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDWR
        protection = mmap.PROT_READ | (mmap.PROT_WRITE if writes else 0)
        # populated, so that the loop meets no page fault on its first way round
        self.memory = mmap.mmap(descriptor, self._task_at, mmap.MAP_SHARED | mmap.MAP_POPULATE, protection)
        self.counters = memoryview(self.memory)[:_COUNTER_BYTES].cast("q")

    @classmethod
    def create(cls, task: Mapping[str, Any], rows: int, columns: int, *, outlives: bool = True) -> Self:
        """Make and lock a ring, which `outlives` its processes or not. Raises HilError for lack of shared memory."""
        text = json.dumps(task, default=str).encode()
        counters = [0] * (_COUNTER_BYTES // 8)
        counters[Counter.RING_ROWS], counters[Counter.COLUMNS] = rows, columns
        counters[Counter.TASK_BYTES] = len(text)
        task_at = ROWS_AT + rows * columns * 8
        path = FOLDER / f"{PATTERN[:-1]}{os.getpid()}-{os.urandom(4).hex()}"
        try:
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            descriptor = os.open(path, flags, 0o600) if outlives else os.memfd_create(path.name)
        except OSError as error:
            raise HilError(f"{path}: no shared memory ({error.strerror}); mount a tmpfs at {FOLDER}") from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            os.posix_fallocate(descriptor, 0, task_at + len(text))  # lack of memory raises here: no SIGBUS in the loop
            os.pwrite(descriptor, struct.pack(f"={len(counters)}q", *counters), 0)
            os.pwrite(descriptor, text, task_at)
            return cls(descriptor)
        except OSError as error:
            os.close(descriptor)
            path.unlink(missing_ok=True)
            raise HilError(
                f"{path}: no shared memory for {rows} rows of {columns} values ({error.strerror}); remove what hil "
                "recover has no use for from there, or make the tmpfs larger"
            ) from None

    @property
    def task(self) -> dict[str, Any]:
        """Description of the recording: path of the stream, channels, metadata, lossless."""
        task: dict[str, Any] = json.loads(os.pread(self.descriptor, self[Counter.TASK_BYTES], self._task_at))
        return task

    @property
    def end(self) -> dict[str, Any] | None:
        """What the loop said at the end of the run; None: it has not ended."""
        size = self[Counter.END_BYTES]
        if not size:
            return None
        end: dict[str, Any] = json.loads(os.pread(self.descriptor, size, self._task_at + self[Counter.TASK_BYTES]))
        return end

    def say_end(self, end: Mapping[str, Any]) -> None:
        """Tell the writer that the run is over. Raises HilError for lack of shared memory."""
        text = json.dumps(end, default=str).encode()
        try:
            os.pwrite(self.descriptor, text, self._task_at + self[Counter.TASK_BYTES])
        except OSError as error:
            raise HilError(f"{self.path}: no shared memory for the end of the run ({error.strerror})") from None
        self[Counter.END_BYTES] = len(text)

    @property
    def error(self) -> str:
        """Why the writer cannot write at present; "" if it can."""
        return bytes(self.memory[_COUNTER_BYTES : _COUNTER_BYTES + self[Counter.ERROR_BYTES]]).decode(errors="replace")

    @error.setter
    def error(self, text: str) -> None:
        data = text.encode()[:_ERROR_BYTES]
        self[Counter.ERROR_BYTES] = 0
        self.memory[_COUNTER_BYTES : _COUNTER_BYTES + len(data)] = data
        self[Counter.ERROR_BYTES] = len(data)

    @property
    def path(self) -> Path:
        """Where the ring is found by others."""
        return Path(os.readlink(f"/proc/self/fd/{self.descriptor}"))

    @property
    def owner(self) -> int:
        """User id of the run."""
        return os.fstat(self.descriptor).st_uid

    def remove(self) -> None:
        """Remove the file; its processes keep the memory until they end."""
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()

    def release(self) -> None:
        """Unlock and close the file; the memory stays until nobody uses it."""
        fcntl.flock(self.descriptor, fcntl.LOCK_UN)
        os.close(self.descriptor)

    def __getitem__(self, counter: Counter) -> int:
        return self.counters[counter]

    def __setitem__(self, counter: Counter, value: int) -> None:
        self.counters[counter] = value
