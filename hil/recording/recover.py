"""Recover a run that was not closed: join the whole blocks of its file and the rows that are still in memory."""

from __future__ import annotations

import fcntl
import json
import mmap
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from hil.arrays import FloatArray
from hil.channels import CHANNELS
from hil.errors import HilError, InputError
from hil.recording.blocks import STREAM_END, read_head, whole_blocks
from hil.recording.recording import arrow_schema, write_table
from hil.recording.ring import FOLDER, PATTERN, ROWS_AT, Counter, Ring
from hil.recording.writer import RowGap


@dataclass(frozen=True)
class Remains:
    """Rows recovered of a run.

    rows (n, channels); from_memory: how many of them were not on the disk; damaged_bytes: of the file, in no whole
    block; metadata: of the run, with its end where the run told it.
    """

    channels: tuple[str, ...]
    rows: FloatArray
    from_memory: int
    damaged_bytes: int
    metadata: dict[str, Any]

    @property
    def period_s(self) -> float:
        """Period of the run, as told or as most rows have it [s]."""
        steps = np.diff(self.rows[:, self.channels.index("time_s")])
        return float(self.metadata.get("period_s") or (round(np.median(steps), 12) if steps.size else 1.0))

    @property
    def gaps(self) -> tuple[RowGap, ...]:
        """Places where the time goes on by more than a period: rows lost, damaged, or ticks that were left out."""
        time_s = self.rows[:, self.channels.index("time_s")]
        missing = np.rint(np.diff(time_s) / self.period_s) - 1
        return tuple(RowGap(int(row) + 1, int(missing[row])) for row in np.flatnonzero(missing > 0))

    @property
    def text(self) -> str:
        """Summary of the recovered rows in one line."""
        lost = sum(gap.rows_lost for gap in self.gaps)
        parts = [f"{len(self.rows)} rows, {self.from_memory} of them from memory"]
        parts += [f"{self.damaged_bytes} bytes of the file are damaged and left out"] if self.damaged_bytes else []
        parts += [f"{lost} periods without a row in {len(self.gaps)} gaps" if lost else "no gap between them"]
        parts += [] if self.metadata else ["the metadata are damaged and left out"]
        return "; ".join(parts)


@contextmanager
def remains(stream: Path) -> Iterator[Remains]:
    """Read the rows of a run from its Arrow stream and from memory.

    The memory is removed when the block ends without error.
    Raises InputError if there is no such file, if it is no stream of a run, if its recorder still works, or if the rows
    in memory are of another user; HilError if no row is left.
    """
    if stream.suffix != ".arrows" or not stream.is_file():
        raise InputError(f"{stream}: given no .arrows file, allowed the stream of a run that was not closed")
    ring = _ring_of(stream)
    try:
        yield _read(stream, ring)
        if ring is not None:
            ring.remove()
    finally:
        if ring is not None:
            ring.release()


def write_remains(found: Remains, path: Path, about: dict[str, Any]) -> None:
    """Write a Parquet file. about: further metadata. Raises InputError if `path` exists or cannot be written."""
    if path.exists():
        raise InputError(f"{path}: the file exists and is not overwritten; give another --out")
    gaps = [gap._asdict() for gap in found.gaps]
    told = {"period_s": found.period_s, "rows": len(found.rows), "gaps": gaps, "recovered": found.text}
    schema = arrow_schema(found.channels, {"ended": "not closed"} | found.metadata | told | about)
    columns = [pa.array(column) for column in np.ascontiguousarray(found.rows.T)]
    write_table(pa.Table.from_arrays(columns, schema=schema), path)


def _read(stream: Path, ring: Ring | None) -> Remains:
    with stream.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        data = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ) if size else b""
    head = read_head(data)
    if head is not None and ("time_s" not in head.channels or not set(head.channels) <= set(CHANNELS)):
        head = None
    task = ring.task if ring is not None else {}
    if head is None and ring is None:
        raise InputError(f"{stream}: its head is damaged or missing, and nothing of the run is in memory")
    channels = head.channels if head is not None else tuple(task["channels"])
    kept_from, kept = _kept(ring) if ring is not None else (None, np.empty((0, len(channels))))
    start = head.end if head is not None else 0
    pieces, due, undamaged = [], 0, start
    for block in whole_blocks(data, start, len(channels)):
        due, undamaged = block.first + len(block.rows), undamaged + block.end - block.start
        pieces.append(block.rows if kept_from is None else block.rows[: max(0, kept_from - block.first)])
    if data[-len(STREAM_END) :] == STREAM_END:
        undamaged += len(STREAM_END)
    rows = np.concatenate([*pieces, kept])
    if not len(rows):
        raise HilError(f"{stream}: no row is left of this run")
    from_memory = 0 if kept_from is None else min(len(kept), max(0, kept_from + len(kept) - due))
    metadata = task.get("metadata") or (json.loads(head.metadata) if head is not None and head.metadata else {})
    end = (ring.end or {}) if ring is not None else {}
    return Remains(channels, rows, from_memory, size - undamaged, metadata | end)


def _kept(ring: Ring) -> tuple[int, FloatArray]:
    """Return the number of the oldest row that a ring still holds, and its rows in order."""
    recorded = ring[Counter.RECORDED]
    first = max(0, recorded - ring.rows)
    rows = np.frombuffer(ring.memory, np.float64, ring.rows * ring.columns, ROWS_AT).reshape(ring.rows, ring.columns)
    return first, rows[np.arange(first, recorded) % ring.rows]


def unfinished() -> list[Path]:
    """Streams of runs of this user whose processes have ended, and of which rows are in memory; for root of all."""
    found = []
    for ring in _rings():
        with suppress(BlockingIOError):
            if _may_take(ring):
                fcntl.flock(ring.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                found.append(Path(ring.task["path"]))
        ring.release()
    return found


def _may_take(ring: Ring) -> bool:
    """True for a ring of this user, and for root: another one may hold anything, and be changed while it is read."""
    return os.geteuid() in (0, ring.owner)


def _ring_of(stream: Path) -> Ring | None:
    """Find and lock the ring of a stream; None if there is none.

    Raises InputError if its recorder still works, or if only another user has a ring of this stream.
    """
    foreign = ""
    for ring in _rings():
        if ring.task["path"] != str(stream.resolve()):
            pass
        elif not _may_take(ring):
            foreign = f"{ring.path} is of the user {ring.owner}"
        else:
            _lock(ring, stream)
            return ring
        ring.release()
    if foreign:
        raise InputError(
            f"{stream}: its rows in memory, {foreign}, allowed are those of your own user ({os.geteuid()}); recover it "
            "as the user of the run or as root, or remove that file if it is not of this run"
        )
    return None


def _lock(ring: Ring, stream: Path) -> None:
    """Lock a ring. Raises InputError, and releases it, if its recorder still works."""
    try:
        fcntl.flock(ring.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        pid = ring[Counter.WRITER_PID]
        ring.release()
        raise InputError(
            f"{stream}: its recorder still works (process {pid}); wait until the run is over, or end a process that "
            "hangs"
        ) from None


def _rings() -> Iterator[Ring]:
    """Open the rings that this user may read; the caller releases them."""
    for path in FOLDER.glob(PATTERN):
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError:  # of another user, or just removed
            continue
        try:
            ring = Ring(descriptor)
            _ = ring.task["path"]
        except (ValueError, KeyError, OSError, struct.error):  # another file, or a ring that was never finished
            os.close(descriptor)
            continue
        yield ring
