"""Leave out rows of a foreign file that hold no new sample: a value is missing or off, or repeats the row before."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.importing.held_samples import kept_rows, lost_samples, slower
from hil.importing.spikes import lone_values
from hil.recording.stamps import REPEATS


@dataclass(frozen=True, eq=False)
class CompleteRows:
    """Columns without NaN, with the number of each row in the file (from 0), and notes on what was left out."""

    columns: dict[str, FloatArray]
    rows: NDArray[np.intp]
    notes: tuple[str, ...]


def complete_rows(
    columns: Mapping[str, FloatArray], rows_per_sample: float | None = None, positions: Collection[str] = ()
) -> CompleteRows:
    """Leave out rows of columns (n,) with NaN or a spike of `positions`, and those that repeat the row before.

    `rows_per_sample`: each sample stands in so many rows, of which one is kept. The clock then shows where rows are
    missing: single ones are interpolated, long stretches are gaps (`stamps.regular_rows`).
    """
    notes = []
    same = np.r_[False, np.logical_and.reduce([np.diff(values) == 0.0 for values in columns.values()])]
    if same.mean() > REPEATS:  # stamps with too few digits
        same[:] = False
    if same.any():
        notes.append(
            f"duplicate rows: {same.sum()} repeat the row before with its stamp, first row "
            f"{int(np.argmax(same)) + 1} of the numbers; they are left out"
        )
    good = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    rows = np.flatnonzero(good & ~same)
    if not good.all():
        lacking = ", ".join(name for name, values in columns.items() if not np.isfinite(values).all())
        first = int(np.flatnonzero(~good)[0]) + 1
        notes.append(
            f"missing: {np.sum(~good)} rows have no value of {lacking} (first row {first} of the numbers) and are left "
            "out: interpolated where they are few, else cut like a gap"
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
    return CompleteRows({name: values[rows] for name, values in columns.items()}, rows, tuple(notes))
