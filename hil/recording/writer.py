"""The recorder beside a real-time loop: the loop packs rows into shared memory, another process writes them.

    record(row) --> ring in shared memory --> hil.recording.writer_process --> NAME.arrows --(close)--> NAME.parquet

The loop never touches the disk. The Arrow stream grows every half second, so that a killed run is readable
up to its last second (`hil.recording.recording.read_recording`); a run that is closed becomes a Parquet file.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import platform
import struct
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from hil.channels import CHANNELS
from hil.errors import HilError, InputError

RING_ROWS = 1 << 16  # about a minute at 1 kHz that the disk may stall
HEADER_BYTES = 128  # two counters, a cache line each: rows recorded, rows on disk
RECORDED, ON_DISK = 0, 8  # their places, in units of 8 bytes
_VERSIONS = ("hil-servo", "numpy", "numba", "python-can", "canopen", "pyserial", "ruckig", "pyarrow")


def run_metadata(
    *, bench: Any, profile: Any, seed: int | None, commands: Sequence[str], start_time: str
) -> dict[str, Any]:
    """Collect the metadata that repeat a run: bench and profile in full, seed, command line, versions, computer.

    `start_time` is an ISO 8601 text; in virtual time the caller gives another text, since
    nothing here reads a clock. All values must be such as JSON holds.
    """
    return {
        "bench": bench,
        "profile": profile,
        "seed": seed,
        "commands": list(commands),
        "start_time": start_time,
        "versions": {"python": platform.python_version()} | {name: version(name) for name in _VERSIONS},
        "computer": {"system": platform.platform(), "node": platform.node()},
    }


class Recorder:
    """Records rows of `channels` (the first is time_s) into `folder`/`name`.parquet; a context manager.

    A name that is taken gets a number, NAME_2; nothing is overwritten. With `lossless` (virtual time)
    `record` waits when the ring is full; without (wall-clock time) it never waits: should the disk stall for
    as long as the ring lasts, the recording ends there, gap-free, and `rows_lost` counts what followed.
    Linux only (memfd). Raises InputError if the folder cannot be written or a channel is unknown.
    """

    def __init__(
        self,
        folder: str | Path,
        name: str,
        channels: Sequence[str],
        period_s: float,
        metadata: Mapping[str, Any],
        *,
        lossless: bool = False,
        ring_rows: int = RING_ROWS,
    ) -> None:
        unknown = [channel for channel in channels if channel not in CHANNELS]
        if unknown or len(set(channels)) != len(channels) or "time_s" not in channels:
            raise InputError(
                f"recorder: given the channels {', '.join(channels)}, allowed time_s and others "
                f"of the channel table, each once; unknown: {', '.join(unknown) or 'none'}"
            )
        self.channels = tuple(channels)
        self.rows_lost = 0
        self._lossless = lossless
        self._ring_rows = ring_rows
        self._row = struct.Struct(f"={len(channels)}d")
        self._pack_into, self._row_bytes = self._row.pack_into, self._row.size
        size = HEADER_BYTES + ring_rows * self._row_bytes
        memory_fd = os.memfd_create("hil-recorder")
        try:
            os.posix_fallocate(memory_fd, 0, size)  # lack of memory raises here, instead of SIGBUS in the loop
            self._memory = mmap.mmap(memory_fd, size)
            self._counters = memoryview(self._memory)[:HEADER_BYTES].cast("q")
            self._head = 0
            self._limit = ring_rows
            self.stream_path = _reserve(Path(folder), name)
            self.path = self.stream_path.with_suffix(".parquet")  # once closed
            task = {
                "memory_fd": memory_fd,
                "path": str(self.stream_path),
                "channels": self.channels,
                "ring_rows": ring_rows,
                "metadata": {**metadata, "period_s": period_s},
            }
            self._process = subprocess.Popen(
                [sys.executable, "-m", "hil.recording.writer_process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                pass_fds=[memory_fd],
                text=True,
                start_new_session=True,
            )  # ctrl-C is for the loop alone
        finally:
            os.close(memory_fd)
        self._ask(task)

    @property
    def rows_recorded(self) -> int:
        """Rows taken into the ring so far."""
        return self._head

    @property
    def rows_on_disk(self) -> int:
        """Rows the writer has handed to the file so far."""
        return int(self._counters[ON_DISK])

    @property
    def writer_pid(self) -> int:
        """Process id of the writer."""
        return self._process.pid

    def record(self, row: Sequence[float]) -> None:
        """Take one row, a value per channel in their order. A tuple is fastest (0.2 us for 24 channels).

        Raises HilError if `lossless` and the writer died.
        """
        head = self._head
        if head >= self._limit and not self._make_room():
            return
        self._pack_into(self._memory, HEADER_BYTES + head % self._ring_rows * self._row_bytes, *row)
        # counter last: the writer reads only complete rows
        self._head = self._counters[RECORDED] = head + 1

    def record_block(self, rows: Any) -> None:
        """Take many rows at once: a contiguous float64 array (n, channels). Raises as `record`."""
        data, done = memoryview(rows).cast("B"), 0
        while done < len(data):
            head = self._head
            if head >= self._limit and not self._make_room():
                self.rows_lost += (len(data) - done) // self._row_bytes - 1  # _make_room counted one
                return
            place = head % self._ring_rows
            count = min(self._limit - head, self._ring_rows - place, (len(data) - done) // self._row_bytes)
            start, size = HEADER_BYTES + place * self._row_bytes, count * self._row_bytes
            self._memory[start : start + size] = data[done : done + size]
            done += size
            self._head = self._counters[RECORDED] = head + count

    def close(self, ended: str = "complete") -> Path | None:
        """End the recording; returns the Parquet file, or None (and no file) without a row.

        `ended` says in the metadata why. Raises HilError if not everything could be written; the Arrow stream
        then stays and holds what was.
        """
        if self._process.returncode is not None:  # closed before, or stopped with an error that was raised
            return None
        end = {"ended": ended, "rows": self._head, "rows_lost": self.rows_lost}
        try:
            written: str | None = self._ask(end)
        finally:
            self._end_process()
        return Path(written) if written else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close("complete" if kind is None else kind.__name__)

    def _make_room(self) -> bool:
        """Return True if the ring has a free row; with `lossless` wait for one."""
        if self.rows_lost == 0:
            self._limit = self.rows_on_disk + self._ring_rows
            while self._lossless and self._head >= self._limit:
                if self._process.poll() is not None:
                    self._ask({})  # raises with the error of the writer
                time.sleep(0.001)
                self._limit = self.rows_on_disk + self._ring_rows
            if self._head < self._limit:
                return True
        self.rows_lost += 1
        self._limit = self._head  # rows after a gap would hide the gap
        return False

    def _end_process(self) -> None:
        """Let the writer end, and wait for it."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()
        self._process.wait()

    def _ask(self, message: Mapping[str, Any]) -> Any:
        """Send the writer a line and return the answer in its line. Raises HilError with its error."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):  # it died; why stands in its answer
            self._process.stdin.write(json.dumps(message, default=str) + "\n")
            self._process.stdin.flush()
        line = self._process.stdout.readline()
        answer = json.loads(line) if line.endswith("\n") else {"error": "its process was killed"}
        if "error" in answer:
            self._end_process()
            raise HilError(
                f"{self.stream_path}: the recorder stopped at row {self.rows_on_disk}: "
                f"{answer['error']}; what was written until then is readable; "
                "make room or choose another folder"
            )
        return answer["done"]


def _reserve(folder: Path, name: str) -> Path:
    """Create the empty stream file: the first of NAME.arrows, NAME_2.arrows ... without a Parquet file."""
    if not name or "/" in name or "\0" in name:
        raise InputError(f"recorder: name: given {name!r}, allowed a file name without folder; the folder is separate")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        number = 1
        while True:
            path = folder / f"{name if number == 1 else f'{name}_{number}'}.arrows"
            if not path.with_suffix(".parquet").exists():
                try:
                    path.touch(exist_ok=False)
                    return path
                except FileExistsError:
                    pass
            number += 1
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None
