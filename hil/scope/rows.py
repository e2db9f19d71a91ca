"""Rows that a scope shows: those of a run in shared memory, those of a recording, and a recording that is replayed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from hil.arrays import FloatArray
from hil.recording.recording import Recording
from hil.recording.ring import ROWS_AT, Counter, Ring


class RowBlock(NamedTuple):
    """Consecutive rows: number of the first one, and the columns (n,) by channel."""

    first: int
    columns: dict[str, FloatArray]

    def __len__(self) -> int:
        return len(self.columns["time_s"])


class ScopeRows(Protocol):
    """Numbered rows of a run. `first` is the oldest one that can still be read, `end` the number after the newest."""

    @property
    def name(self) -> str: ...

    @property
    def channels(self) -> tuple[str, ...]: ...

    @property
    def period_s(self) -> float: ...

    @property
    def metadata(self) -> dict[str, Any]: ...

    @property
    def first(self) -> int: ...

    @property
    def end(self) -> int: ...

    @property
    def ended(self) -> bool:
        """True when no further row comes."""
        ...

    def read(self, first: int, end: int) -> RowBlock:
        """Return the rows first .. end - 1; those that are no longer or not yet there are left out."""
        ...


@dataclass(frozen=True, eq=False)
class FixedRows:
    """Rows that do not change: a recording, or a copy of the rows of a run. `number` is that of the first row."""

    name: str
    columns: dict[str, FloatArray]
    period_s: float
    metadata: dict[str, Any] = field(default_factory=dict)
    number: int = 0

    @classmethod
    def of_recording(cls, recording: Recording) -> FixedRows:
        """Rows of a recording."""
        return cls(recording.name, recording.columns, recording.period_s, recording.metadata)

    @classmethod
    def copy(cls, rows: ScopeRows, first: int, end: int) -> FixedRows:
        """Copy of the rows first .. end - 1, as far as they are there."""
        block = rows.read(first, end)
        return cls(rows.name, block.columns, rows.period_s, rows.metadata, block.first)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    @property
    def first(self) -> int:
        """Number of the first row."""
        return self.number

    @property
    def end(self) -> int:
        """Number after the last row."""
        return self.number + self.columns["time_s"].size

    @property
    def ended(self) -> bool:
        """True: no further row comes."""
        return True

    def read(self, first: int, end: int) -> RowBlock:
        """Return rows first .. end - 1, as views."""
        first = min(max(first, self.first), self.end)
        rows = slice(first - self.number, max(first, end) - self.number)
        return RowBlock(first, {name: values[rows] for name, values in self.columns.items()})

    def number_at(self, time_s: float) -> int:
        """Number of the first row at or after a time [s]; `end` if there is none."""
        return self.number + int(np.searchsorted(self.columns["time_s"], time_s - 1e-3 * self.period_s))


class RingRows:
    """Rows of a run in shared memory, only read: neither the loop nor the writer knows of it. The loop may write over
    rows while they are read; `read` leaves those out. owner: process id of the loop.

    Raises ValueError, KeyError or OSError for a ring that is not made completely, or another file.
    """

    def __init__(self, ring: Ring, owner: int) -> None:
        self._ring, self._process, task = ring, Path(f"/proc/{owner}"), ring.task
        self.channels = tuple(task["channels"])
        self.metadata: dict[str, Any] = task["metadata"]
        self.period_s = float(self.metadata["period_s"])
        self.path = Path(task["path"])  # of the stream
        self.name = self.path.stem
        if len(self.channels) != ring.columns or "time_s" not in self.channels:
            raise ValueError("not the ring of a run")
        values = np.frombuffer(ring.memory, np.float64, ring.rows * ring.columns, ROWS_AT)
        self._rows = values.reshape(ring.rows, ring.columns)

    @property
    def ended(self) -> bool:
        """True when the loop has said the end of the run, or is gone."""
        return self._ring[Counter.END_BYTES] > 0 or not self._process.exists()

    @property
    def first(self) -> int:
        """Number of the oldest row; the loop may be writing the one before it."""
        return max(0, self.end - len(self._rows) + 1)

    @property
    def end(self) -> int:
        """Rows recorded so far."""
        return self._ring[Counter.RECORDED]

    def read(self, first: int, end: int) -> RowBlock:
        """Return a copy of rows first .. end - 1, without those that were written over meanwhile."""
        end = min(end, self.end)
        first = min(max(first, self.first), end)
        copied = self._rows[np.arange(first, end) % len(self._rows)]
        kept = min(max(first, self.first), end)
        return RowBlock(kept, dict(zip(self.channels, copied[kept - first :].T, strict=True)))


class ReplayedRows:
    """A recording whose rows come one after the other from row `begin` on, `speed` times as fast as they were taken."""

    def __init__(self, rows: FixedRows, begin: int, speed: float, now_s: Callable[[], float]) -> None:
        self._rows, self._begin, self._speed, self._now_s = rows, begin, speed, now_s
        self._start_s = now_s()
        self.name, self.channels, self.period_s = rows.name, rows.channels, rows.period_s
        self.metadata = rows.metadata

    @property
    def first(self) -> int:
        """Number of the first row of the recording."""
        return self._rows.first

    @property
    def end(self) -> int:
        """Number after the last row that has come so far."""
        come = int((self._now_s() - self._start_s) * self._speed / self.period_s)
        return min(self._begin + come, int(self._rows.end))

    @property
    def ended(self) -> bool:
        """True when all rows have come."""
        return self.end == self._rows.end

    def read(self, first: int, end: int) -> RowBlock:
        """Return rows first .. end - 1, as views."""
        return self._rows.read(first, min(end, self.end))
