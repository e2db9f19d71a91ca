"""Make a recording of what is left of a run that was not closed: whole blocks of its stream, rows still in memory."""

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
from hil.errors import HilError, InputError
from hil.recording.blocks import STREAM_END, read_schema, whole_blocks
from hil.recording.recording import METADATA_KEY, arrow_schema, write_table
from hil.recording.ring import FOLDER, PATTERN, ROWS_AT, Counter, Ring
from hil.recording.writer import RowGap


@dataclass(frozen=True)
class Remains:
    """What is left of a run. rows (n, channels); from_memory: rows of them that were not on the disk; damaged_bytes: of
    the file, in no whole block; metadata: of the run, with its end where the run told it."""

    channels: tuple[str, ...]
    rows: FloatArray
    from_memory: int
    damaged_bytes: int
    metadata: dict[str, Any]

    @property
    def gaps(self) -> tuple[RowGap, ...]:
        """Places where the time goes on by more than a period: rows lost, damaged, or ticks that were left out."""
        time_s = self.rows[:, self.channels.index("time_s")]
        missing = np.rint(np.diff(time_s) / self.metadata["period_s"]) - 1
        return tuple(RowGap(int(row) + 1, int(missing[row])) for row in np.flatnonzero(missing > 0))

    @property
    def text(self) -> str:
        """What was found, in one line."""
        lost = sum(gap.rows_lost for gap in self.gaps)
        parts = [f"{len(self.rows)} rows, {self.from_memory} of them from memory"]
        parts += [f"{self.damaged_bytes} bytes of the file are damaged and left out"] if self.damaged_bytes else []
        parts += [f"{lost} periods without a row in {len(self.gaps)} gaps" if lost else "no gap between them"]
        return "; ".join(parts)


@contextmanager
def remains(stream: Path) -> Iterator[Remains]:
    """Read what is left of the run of an Arrow stream. What is in memory is removed when the block ends without error.

    Raises InputError if there is no such file, if it is no stream of a run, or if its recorder still works; HilError
    if no row is left.
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
    told = {"rows": len(found.rows), "gaps": gaps, "recovered": found.text}
    schema = arrow_schema(found.channels, {"ended": "not closed"} | found.metadata | told | about)
    columns = [pa.array(column) for column in np.ascontiguousarray(found.rows.T)]
    write_table(pa.Table.from_arrays(columns, schema=schema), path)


def _read(stream: Path, ring: Ring | None) -> Remains:
    with stream.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        data = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ) if size else b""
    head = read_schema(data)
    if head is None and ring is None:
        raise InputError(f"{stream}: its head is damaged or missing, and nothing of the run is in memory")
    task = ring.task if ring is not None else {}
    schema, start = head or (arrow_schema(tuple(task["channels"]), task["metadata"]), 0)
    if "time_s" not in schema.names or any(field.type != pa.float64() for field in schema):
        raise InputError(f"{stream}: is no stream of a run; it has the columns {', '.join(schema.names)}")
    metadata = json.loads((schema.metadata or {}).get(METADATA_KEY, b"{}"))
    kept_from, kept = _kept(ring) if ring is not None else (None, np.empty((0, len(schema))))
    pieces, due, undamaged = [], 0, start
    for block in whole_blocks(data, start, schema):
        first = due if block.first is None else block.first
        due, undamaged = first + len(block.rows), undamaged + block.end - block.start
        pieces.append(block.rows if kept_from is None else block.rows[: max(0, kept_from - first)])
    if data[-len(STREAM_END) :] == STREAM_END:
        undamaged += len(STREAM_END)
    rows = np.concatenate([*pieces, kept])
    if not len(rows):
        raise HilError(f"{stream}: no row is left of this run")
    from_memory = 0 if kept_from is None else min(len(kept), max(0, kept_from + len(kept) - due))
    end = (ring.end or {}) if ring is not None else {}
    return Remains(tuple(schema.names), rows, from_memory, size - undamaged, metadata | end)


def _kept(ring: Ring) -> tuple[int, FloatArray]:
    """Return the number of the oldest row that a ring still holds, and its rows in order."""
    recorded = ring[Counter.RECORDED]
    first = max(0, recorded - ring.rows)
    rows = np.frombuffer(ring.memory, np.float64, ring.rows * ring.columns, ROWS_AT).reshape(ring.rows, ring.columns)
    return first, rows[np.arange(first, recorded) % ring.rows]


def unfinished() -> list[Path]:
    """Streams of runs whose processes have ended, and of which rows are in memory."""
    found = []
    for ring in _rings():
        with suppress(BlockingIOError):
            fcntl.flock(ring.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            found.append(Path(ring.task["path"]))
        ring.release()
    return found


def _ring_of(stream: Path) -> Ring | None:
    """Find and lock the ring of a stream; None if there is none. Raises InputError if its recorder still works."""
    found = None
    for ring in _rings():
        if found is not None or ring.task["path"] != str(stream.resolve()):
            ring.release()
            continue
        found = ring
        try:
            fcntl.flock(ring.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            ring.release()
            raise InputError(f"{stream}: its recorder still works; wait until the run is over") from None
    return found


def _rings() -> Iterator[Ring]:
    """Open the rings of this user; the caller releases them."""
    for path in FOLDER.glob(PATTERN):
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        except OSError:  # of another user, or just removed
            continue
        try:
            ring = Ring(descriptor)
            _ = ring.task["path"]
        except (ValueError, KeyError, OSError, struct.error):  # another file, or a ring that was never finished
            os.close(descriptor)
            continue
        yield ring
