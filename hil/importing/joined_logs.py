"""Join the files of several loggers of one run into one, by their stamps.

The rows are those of the slowest logger within the time that all have; channels of the others are interpolated to them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.date_stamps import DAY_S, HOUR_S
from hil.importing.channel_clocks import on_one_clock
from hil.importing.clock import find_clock, time_columns
from hil.importing.draft_map import labels_of, scaled
from hil.importing.foreign_table import read_table
from hil.importing.rows import without_duplicates
from hil.importing.units import split_unit
from hil.quantities import digits

_DATED_S = 1e8  # stamps that are larger count from 1970
_LEAST = 0.5  # of the shortest run: what all must have in common
STAMP = "time [s]"


@dataclass(frozen=True, eq=False)
class _Log:
    """Stamps (n,) of a logger [s], and the channels (n,) of its file with their units."""

    name: str
    stamps_s: FloatArray
    columns: dict[str, FloatArray]
    dated: bool

    @property
    def step_s(self) -> float:
        return float(np.median(np.diff(self.stamps_s)))

    @property
    def span_s(self) -> float:
        return float(np.ptp(self.stamps_s))


def join_logs(paths: Sequence[Path], joined: Path) -> str:
    """Write the channels of all files to `joined` (.csv), stamps first; return a note on what was assumed.

    Clocks with dates may differ by whole hours, of time zones; others are one clock. Raises InputError: a file without
    stamps, or loggers with less than half of the shortest run in common.
    """
    logs = [_read(path) for path in paths]
    shifts_h = [_hours(logs[0], one) for one in logs]
    shifted = [one.stamps_s - HOUR_S * shift for one, shift in zip(logs, shifts_h, strict=True)]
    begin_s, end_s = max(one[0] for one in shifted), min(one[-1] for one in shifted)
    names = listed(one.name for one in logs)
    if end_s - begin_s < _LEAST * min(one.span_s for one in logs):
        raise InputError(
            f"{names}: their stamps have {digits(max(end_s - begin_s, 0.0))} s in common, allowed half of the shortest "
            "file or more; give the loggers of one run, or a file with a column for each channel"
        )
    slowest = max(range(len(logs)), key=lambda at: logs[at].step_s)
    rows_s = shifted[slowest]
    within_s = 0.5 * logs[slowest].step_s  # stamps of one tick differ by their digits
    rows_s = rows_s[(rows_s >= begin_s - within_s) & (rows_s <= end_s + within_s)]
    table = {STAMP: rows_s - rows_s[0]}
    for one, stamps_s in zip(logs, shifted, strict=True):
        for name, values in one.columns.items():
            good = np.isfinite(values)
            free = name if name not in table else f"{Path(one.name).stem}.{name}"
            table[free] = np.interp(rows_s, stamps_s[good], values[good])
    joined.parent.mkdir(parents=True, exist_ok=True)
    csv.write_csv(pa.table(table), joined)
    zones = [f"{one.name} by {shift:+g} h" for one, shift in zip(logs, shifts_h, strict=True) if shift]
    return (
        f"{joined}: {names} are taken for loggers of one run and joined by their stamps, at the {rows_s.size} rows of "
        f"{logs[slowest].name}, the slowest{f'; clocks shifted: {listed(zones)}' if zones else ''}"
    )


def _read(path: Path) -> _Log:
    table = read_table(path)
    times = time_columns(table, labels_of(table))
    table = on_one_clock(table, labels_of(table)).table
    table = replace(table, columns=without_duplicates(table.columns).columns, lines=None)
    clock = find_clock(table, labels_of(table), None)
    if clock.time is None:
        raise InputError(f"{path}: has no stamps by which to join another logger; give a file with them")
    first_s = float(table.columns[clock.time.column][0]) * clock.time.seconds
    dated = clock.time.column in table.dates or first_s > _DATED_S
    left_out = {*clock.columns, *times}
    columns = {
        _titled(name, table.units.get(name, "")): scaled(table, name)
        for name, values in table.columns.items()
        if name not in left_out and np.isfinite(values).any()
    }
    return _Log(path.name, (first_s % DAY_S if dated else first_s) + clock.time_s, columns, dated)


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit and split_unit(name)[1] is None else name


def _hours(first: _Log, other: _Log) -> float:
    """Whole hours by which the clock of another logger is ahead, if both are dates."""
    apart_s = float(other.stamps_s[0] - first.stamps_s[0])
    return float(round(apart_s / HOUR_S)) if first.dated and other.dated else 0.0
