"""Prepare the columns of a foreign table for its relations: duplicate rows, wraps, missing values, an even clock."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from hil.arrays import FloatArray
from hil.importing.clock import StampClock
from hil.importing.column_names import Label, Quantity
from hil.importing.foreign_table import ForeignTable
from hil.importing.wraps import wrap_range
from hil.recording.stamps import LARGEST, REPEATS, regular_rows


@dataclass(frozen=True, eq=False)
class EvenRows:
    """Columns (n,) of the longest part without gaps; `rate_hz` if they are interpolated; notes on the whole clock."""

    columns: dict[str, FloatArray]
    period_s: float
    rate_hz: float | None
    notes: tuple[str, ...]


def without_duplicates(table: ForeignTable) -> tuple[ForeignTable, tuple[str, ...]]:
    """Leave out rows that repeat the row before in every column, its stamp too, where they are few; say so.

    Without a column that grows in all other rows, equal rows are those of an axis at rest.
    """
    same = np.logical_and.reduce([np.diff(values) == 0.0 for values in table.columns.values()])
    kept = np.r_[True, ~same]
    stamped = any(bool(np.all(np.diff(values[kept]) > 0.0)) for values in table.columns.values())
    if not same.any() or same.mean() > REPEATS or not stamped:
        return table, ()
    note = f"duplicate rows: {same.sum()} repeat the row before, first row {np.flatnonzero(same)[0] + 2} of the numbers"
    return (
        replace(table, columns={name: values[kept] for name, values in table.columns.items()}),
        (f"{note}; they are left out",),
    )


def find_wraps(columns: dict[str, FloatArray], labels: dict[str, Label]) -> dict[str, float]:
    """Ranges of the positions, and of columns whose names say nothing, that wrap."""
    kinds = (Quantity.POSITION, Quantity.UNKNOWN)
    ranges = {name: wrap_range(values) for name, values in columns.items() if labels[name].quantity in kinds}
    return {name: size for name, size in ranges.items() if size is not None}


def filled_in(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """A column (n,) with missing values interpolated, for relations only."""
    good = np.isfinite(values)
    return values if good.all() else np.interp(time_s, time_s[good], values[good])


def even_rows(
    path: Path, columns: dict[str, FloatArray], time_s: FloatArray, judged_by: Collection[str] = ()
) -> EvenRows:
    """Columns (n,) without missing values on an even clock, of the part with most rows.

    `judged_by` are the columns that tell jitter of the stamps from jitter of the rows, by default all.

    Raises InputError: two rates, time that repeats or runs back.
    """
    usual = {name: values for name, values in columns.items() if np.max(np.abs(values)) <= LARGEST}
    place = partial(_place, path)
    rows = regular_rows(usual | {"time_s": time_s}, place, judged_by=[name for name in judged_by if name in usual])
    edges = [*(part.row for part in rows.parts), rows.columns["time_s"].size]
    longest = max(range(len(rows.parts)), key=lambda part: edges[part + 1] - edges[part])
    piece = slice(edges[longest], edges[longest + 1])
    longest_part = {name: values[piece] for name, values in rows.columns.items() if name != "time_s"}
    return EvenRows(longest_part, rows.period_s, rows.rate_hz, rows.notes)


def _place(path: Path, row: int) -> str:
    return f"{path}: row {row + 1} of the numbers"


def with_rate(clock: StampClock, rows: EvenRows) -> StampClock:
    """The clock with the rate to which the rows are interpolated."""
    return replace(clock, resample_hz=rows.rate_hz)
