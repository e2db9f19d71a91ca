"""Rows of a foreign file: complete, one per sample of the loop, and at regular times."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.importing.held_samples import kept_rows, lost_samples, slower
from hil.importing.slow_columns import rows_per_value
from hil.importing.slow_gaps import late_stamps, moving_little, with_gaps_filled
from hil.importing.spikes import lone_values
from hil.importing.stamp_columns import counted_on, range_of
from hil.recording.stamps import LARGEST, REPEATS, RegularRows, regular_rows


@dataclass(frozen=True, eq=False)
class KeptRows:
    """Columns of the rows that are kept, the number of each row in the file (from 0), and notes on the others."""

    columns: dict[str, FloatArray]
    rows: NDArray[np.intp]
    notes: tuple[str, ...]


def without_duplicates(columns: Mapping[str, FloatArray]) -> KeptRows:
    """Leave out rows that repeat the row before in every column (n,), its stamp too, where they are few.

    Without a column that grows in all other rows, equal rows are those of an axis at rest.
    """
    same = np.r_[False, np.logical_and.reduce([np.diff(values) == 0.0 for values in columns.values()])]
    distinct = [values[~same] for values in columns.values()]
    stamped = any(bool(np.all(np.diff(counted_on(one, range_of(one))) > 0.0)) for one in distinct)
    if not same.any() or same.mean() > REPEATS or not stamped:
        return KeptRows(dict(columns), np.arange(same.size), ())
    note = (
        f"duplicate rows: {same.sum()} repeat the row before with its stamp, first row {int(np.argmax(same)) + 1} of "
        "the numbers; they are left out"
    )
    return KeptRows({name: values[~same] for name, values in columns.items()}, np.flatnonzero(~same), (note,))


def complete_rows(
    columns: Mapping[str, FloatArray], rows_per_sample: float | None = None, positions: Collection[str] = ()
) -> KeptRows:
    """Leave out rows of columns (n,) with NaN or a spike of `positions`, and those that repeat the row before.

    `rows_per_sample`: each sample stands in so many rows, of which one is kept. The clock then shows where rows are
    missing: single ones are interpolated, long stretches are gaps (`stamps.regular_rows`).
    """
    distinct = without_duplicates(columns)
    notes = [*distinct.notes]
    good = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    rows = distinct.rows[good[distinct.rows]]
    if not good.all():
        lacking = [name for name, values in columns.items() if not np.isfinite(values).all()]
        slow = [name for name in lacking if rows_per_value(columns[name])]
        taken = np.logical_and.reduce([np.isfinite(columns[name]) for name in slow] or [np.ones_like(good)])
        if slow:
            notes.append(
                f"rates: {', '.join(slow)}: slower than the rows; {rows.size} of {good.size} rows have all values, and "
                "are taken"
            )
        if others := [name for name in lacking if not np.isfinite(columns[name][taken]).all()]:
            bad = taken & ~good
            first = int(np.argmax(bad)) + 1
            notes.append(
                f"missing: {np.sum(bad)} rows have no value of {', '.join(others)} (first row {first} of the numbers) "
                "and are left out: interpolated where they are few, else cut like a gap"
            )
    told = {name: values[rows] for name, values in columns.items() if name != "time_s"}
    lost = lost_samples(told) if rows_per_sample is None else np.zeros(rows.size, dtype=np.bool_)
    if lost.any():
        notes.append(
            f"lost samples: {lost.sum()} rows ({lost.mean():.1%}) in motion repeat all values of the row before, "
            f"first row {int(rows[lost][0]) + 1} of the numbers; they are left out and interpolated"
        )
        rows = rows[~lost]
    if rows_per_sample is not None:
        kept = kept_rows(told, rows_per_sample)
        slow = slower(told, rows_per_sample)
        which = f"{', '.join(slow)}: sampled more slowly than the rows" if 0 < len(slow) < len(told) else "all columns"
        notes.append(
            f"repeated samples: each stands in {rows_per_sample:g} rows ({which}); {kept.size} of {rows.size} rows are "
            "kept, one per sample"
        )
        rows = rows[kept]
    for name in positions:
        off = lone_values(columns[name][rows])
        if off.any():
            notes.append(
                f"spikes: {name} is off the motion for one row in {off.sum()} places, first row "
                f"{int(rows[off][0]) + 1} of the numbers; these rows are left out and interpolated"
            )
            rows = rows[~off]
    complete = {name: values[rows] for name, values in columns.items()}
    for name in positions:
        late = late_stamps(complete[name], complete["time_s"])
        if late.size:
            notes.append(
                f"late stamps: {late.size} rows have a stamp of more than a period after the moment that {name} tells, "
                f"first row {int(rows[late[0]]) + 1} of the numbers; they are taken one period after the row before"
            )
            period_s = np.median(np.diff(complete["time_s"]))
            complete["time_s"][late] = complete["time_s"][late - 1] + period_s
    if "time_s" in complete and rows.size > 2 and moving_little(complete, positions):
        complete, before, note = with_gaps_filled(complete)
        rows, notes = rows[before], [*notes, note]
    return KeptRows(complete, rows, tuple(notes))


def filled_in(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """A column (n,) with missing values interpolated, for relations only."""
    good = np.isfinite(values)
    return values if good.all() else np.interp(time_s, time_s[good], values[good])


def at_regular_times(
    path: Path, columns: Mapping[str, FloatArray], time_s: FloatArray, judged_by: Collection[str] = ()
) -> RegularRows:
    """Columns (n,) without missing values at regular times (`stamps.regular_rows`); unusually large ones are left out.

    Raises InputError: two rates, time that repeats or runs back.
    """
    usual = {name: values for name, values in columns.items() if np.max(np.abs(values)) <= LARGEST}
    return regular_rows(
        usual | {"time_s": time_s},
        lambda row: f"{path}: row {row + 1} of the numbers",
        judged_by=[name for name in judged_by if name in usual],
    )
