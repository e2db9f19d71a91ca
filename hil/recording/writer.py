"""The recorder beside a real-time loop: the loop packs rows into shared memory, another process writes them.

    record(row) --> hil.recording.ring --> hil.recording.writer_process --> NAME.arrows --(close)--> NAME.parquet
                                             ^ started and replaced by hil.recording.keeper

The loop never touches the disk and never waits for it. The Arrow stream grows every 40 ms; a run that is closed
becomes a Parquet file. What is not on the disk is in the ring, which outlives every process
(`hil.recording.recover`).
"""

from __future__ import annotations

import contextlib
import platform
import struct
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, NamedTuple, Self

from hil.channels import CHANNELS
from hil.errors import HilError, InputError
from hil.recording.keeper import end_if_stopped
from hil.recording.ring import ROWS_AT, Counter, Ring

RING_ROWS = 1 << 16  # about a minute at 1 kHz that the disk may stall
_RECORDED = int(Counter.RECORDED)  # the look-up of an enumeration takes longer than a row
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


class RowGap(NamedTuple):
    """A place without rows. row: number of the row after it."""

    row: int
    rows_lost: int


class Recorder:
    """Records rows of `channels` (the first is time_s) into `folder`/`name`.parquet; a context manager.

    A name that is taken gets a number, NAME_2; nothing is overwritten. With `lossless` (virtual time) `record` waits
    when the ring is full, and an error of the disk ends the recording; without (wall-clock time) it never waits: rows
    wait in the ring until the disk has room. Should that last for longer than the ring, rows are lost until half of it
    is free again: `gaps` tells where, `rows_lost` how many. Linux only. Raises InputError if the folder cannot be
    written or a channel is unknown, HilError for lack of shared memory.
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
        self.gaps: list[RowGap] = []
        self._lossless = lossless
        self._row = struct.Struct(f"={len(channels)}d")
        self._pack_into, self._row_bytes = self._row.pack_into, self._row.size
        self._head, self._limit, self._ring_rows = 0, ring_rows, ring_rows
        self.stream_path = _reserve(Path(folder), name)
        self.path = self.stream_path.with_suffix(".parquet")  # once closed
        task = {
            "path": str(self.stream_path.resolve()),
            "channels": self.channels,
            "lossless": lossless,
            "metadata": {**metadata, "period_s": period_s},
        }
        try:
            # a run in virtual time can be repeated: nothing of it has to outlive its processes
            self._ring = Ring.create(task, ring_rows, len(channels), outlives=not lossless)
        except HilError:
            self.stream_path.unlink(missing_ok=True)
            raise
        self._memory, self._counters = self._ring.memory, self._ring.counters
        self._closed = False
        self._start_keeper()
        try:
            while not self._ring[Counter.READY]:
                self._check_keeper()
                time.sleep(0.001)
        except HilError:
            self.stream_path.unlink(missing_ok=True)
            raise

    @property
    def rows_recorded(self) -> int:
        """Rows taken into the ring so far."""
        return self._head

    @property
    def rows_on_disk(self) -> int:
        """Rows the writer has handed to the file so far."""
        return self._ring[Counter.ON_DISK]

    @property
    def rows_lost(self) -> int:
        """Rows that found no room in the ring."""
        return sum(gap.rows_lost for gap in self.gaps)

    @property
    def writer_pid(self) -> int:
        """Process id of the present writer."""
        return self._ring[Counter.WRITER_PID]

    @property
    def keeper_pid(self) -> int:
        """Process id of the keeper of the writer."""
        return self._keeper.pid

    @property
    def error(self) -> str:
        """Why no row can be written at present; "" if rows can."""
        return self._ring.error

    def record(self, row: Sequence[float]) -> None:
        """Take one row, a value per channel in their order. A tuple is fastest (0.2 us for 24 channels).

        Raises HilError if `lossless` and the disk has no room.
        """
        head = self._head
        if head >= self._limit and not self._make_room(1):
            return
        self._pack_into(self._memory, ROWS_AT + head % self._ring_rows * self._row_bytes, *row)
        # counter last: the writer reads only complete rows
        self._head = self._counters[_RECORDED] = head + 1

    def record_block(self, rows: Any) -> None:
        """Take many rows at once: a contiguous float64 array (n, channels). Raises as `record`."""
        data, done = memoryview(rows).cast("B"), 0
        while done < len(data):
            head = self._head
            if head >= self._limit and not self._make_room((len(data) - done) // self._row_bytes):
                return
            place = head % self._ring_rows
            count = min(self._limit - head, self._ring_rows - place, (len(data) - done) // self._row_bytes)
            start, size = ROWS_AT + place * self._row_bytes, count * self._row_bytes
            self._memory[start : start + size] = data[done : done + size]
            done += size
            self._head = self._counters[_RECORDED] = head + count

    def close(self, ended: str = "complete", about: Mapping[str, Any] = MappingProxyType({})) -> Path | None:
        """End the recording; returns the Parquet file, or None (and no file) without a row.

        `ended` says in the metadata why; about: further metadata. Raises HilError if not everything could be written;
        the Arrow stream then stays and holds what was, the ring holds the rest.
        """
        if self._closed:  # closed before, or stopped with an error that was raised
            return None
        end: dict[str, Any] = {"ended": ended, "rows": self._head, "rows_lost": self.rows_lost, **about}
        if self.gaps:
            end["gaps"] = [gap._asdict() for gap in self.gaps]
        self._ring.say_end(end)
        self._wake_writer()
        while not (self._check_keeper() and (finished := self._ring[Counter.FINISHED])):
            time.sleep(0.001)
        self._closed = True
        self._close_pipe()
        self._ring.release()
        return self.path if finished == 1 else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close("complete" if kind is None else kind.__name__)

    def _make_room(self, rows: int) -> bool:
        """Return True if the ring has a free row, else count the rows as lost; with `lossless` wait for a free row."""
        limit = self.rows_on_disk + self._ring_rows
        while self._lossless and self._head >= limit:
            self._check_keeper()
            time.sleep(0.001)
            limit = self.rows_on_disk + self._ring_rows
        in_gap = bool(self.gaps) and self.gaps[-1].row == self._head
        # few long parts, not many short ones, from a disk that is too slow
        if self._head < (limit - self._ring_rows // 2 if in_gap else limit):
            self._limit = limit
            return True
        self._limit = self._head
        lost = self.gaps.pop().rows_lost if in_gap else 0
        self.gaps.append(RowGap(self._head, lost + rows))
        return False

    def _start_keeper(self) -> None:
        self._keeper = subprocess.Popen(
            [sys.executable, "-P", "-m", "hil.recording.keeper", str(self._ring.descriptor)],
            stdin=subprocess.PIPE,
            pass_fds=[self._ring.descriptor],
            start_new_session=True,
        )  # ctrl-C is for the loop alone

    def _wake_writer(self) -> None:
        assert self._keeper.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._keeper.stdin.write(b"\n")
            self._keeper.stdin.flush()

    def _check_keeper(self) -> bool:
        """Replace a keeper that was killed or stopped; True if it is done. Raises HilError if the recording cannot be
        written."""
        end_if_stopped(self._keeper)
        code, ring = self._keeper.returncode, self._ring
        if code is None or (code == 0 and ring[Counter.FINISHED]):
            return code == 0
        self._close_pipe()
        if code <= 0:
            self._start_keeper()
            self._wake_writer()
            return False
        self._closed = True
        reason = ring.error or f"its process ended with exit code {code}, see above"
        waiting = self._head - self.rows_on_disk
        if self._head and not self._lossless:
            rest = (
                f"{waiting} rows are in memory only ({ring.path}), until this PC is switched off: make room, then "
                f"hil recover {self.stream_path}"
            )
        else:
            ring.remove()
            rest = "make room or choose another folder"
        ring.release()
        raise HilError(
            f"{self.stream_path}: the recorder stopped at row {self.rows_on_disk}: {reason}; what was written until "
            f"then is readable; {rest}"
        )

    def _close_pipe(self) -> None:
        """Close the pipe to a keeper that has ended."""
        assert self._keeper.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._keeper.stdin.close()


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
