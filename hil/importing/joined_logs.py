"""Join the files of several loggers of one run into one, by their stamps, or by the numbers of equal rows.

The rows are those of the slowest logger with a position or a torque, within the time that all have. Of a faster logger
a row has the mean over the time of a row, of a slower one the value between its stamps; none where a logger has a gap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.date_stamps import DAY_S
from hil.files.output import write_text
from hil.importing.channel_clocks import on_one_clock
from hil.importing.clock import find_clock, time_columns
from hil.importing.draft_map import labels_of, scaled
from hil.importing.foreign_table import read_table
from hil.importing.lexicon import Constant, Quantity
from hil.importing.readme import NO_HINTS, FileHints, with_readme
from hil.importing.row_counters import counts_rows
from hil.importing.rows import without_duplicates
from hil.importing.units import split_unit
from hil.importing.wraps import unwrapped, wrap_range
from hil.quantities import digits

_DATED_S = 1e8  # stamps that are larger count from 1970
_ZONE_S = 900.0  # zones of time differ by quarters of an hour
_LEAST = 0.5  # of the shortest run: what all must have in common
_GAP = 5.0  # steps of a logger: what it does not tell
STAMP = "time [s]"


@dataclass(frozen=True, eq=False)
class _Log:
    """Stamps (n,) of a logger [s], the channels (n,) of its file, and lines on its constants.

    `dated`: the stamps are of a day. `moves`: it has a position, a speed or a torque. `numbered`: it has no stamps but
    a rate.
    """

    name: str
    stamps_s: FloatArray
    columns: dict[str, FloatArray]
    told: tuple[str, ...]
    dated: bool
    moves: bool
    numbered: bool

    @property
    def step_s(self) -> float:
        return float(np.median(np.diff(self.stamps_s)))

    def common_s(self, other: "_Log", shift_s: float = 0.0) -> float:
        """Time that both have [s], if the stamps of the other are `shift_s` ahead; negative without any."""
        begin_s = max(self.stamps_s[0], other.stamps_s[0] - shift_s)
        return float(min(self.stamps_s[-1], other.stamps_s[-1] - shift_s) - begin_s)

    def enough(self, other: "_Log", shift_s: float = 0.0) -> bool:
        """True if both have half of the shorter run in common."""
        return self.common_s(other, shift_s) >= _LEAST * min(float(np.ptp(one.stamps_s)) for one in (self, other))


def join_logs(paths: Sequence[Path], joined: Path, one_is_whole: bool = False, hints: FileHints = NO_HINTS) -> str:
    """Write the channels of all files to `joined` (.csv), stamps first; return a note on what was assumed.

    Clocks with dates may differ by the zone of time; others are one clock, unless `one_is_whole`: a file that is a
    recording by itself is joined by dates alone. Files without stamps, of one rate and as many rows, have the same
    rows; `hints` may tell the rate. Raises InputError: a file without stamps beside one with them, a clock that runs
    back, or loggers with less than half of the shortest run in common.
    """
    logs = [_read(path, hints) for path in paths]
    if any(one.numbered for one in logs) and len({(one.numbered, *one.stamps_s[[1, -1]]) for one in logs}) > 1:
        bare = next(one.name for one in logs if one.numbered)
        raise InputError(f"{bare}: has no stamps by which to join another logger; give a file with them")
    names = listed(one.name for one in logs)
    if one_is_whole and not all(one.dated for one in logs):
        raise InputError(
            f"{names}: one lacks the position or the torque, another has both, and their stamps are no dates that tell "
            "loggers of one run; leave the one without them out, or give one file with a column for each channel"
        )
    shifts_s = [_zone(logs[0], one) for one in logs]
    for one, shift_s in zip(logs, shifts_s, strict=True):
        if not logs[0].enough(one, shift_s):
            raise InputError(
                f"{names}: their stamps have {digits(max(logs[0].common_s(one, shift_s), 0.0))} s in common, allowed "
                "half of the shortest file or more; give the loggers of one run, or a file with a column for each "
                "channel"
            )
    shifted = [replace(one, stamps_s=one.stamps_s - shift_s) for one, shift_s in zip(logs, shifts_s, strict=True)]
    rows = max((one for one in shifted if one.moves), key=lambda one: one.step_s, default=shifted[0])
    begin_s, end_s = max(one.stamps_s[0] for one in shifted), min(one.stamps_s[-1] for one in shifted)
    within_s = 0.5 * rows.step_s  # stamps of one tick differ by their digits
    rows_s = rows.stamps_s[(rows.stamps_s >= begin_s - within_s) & (rows.stamps_s <= end_s + within_s)]
    table = {STAMP: rows_s - rows_s[0]}
    for one in shifted:
        for name, values in one.columns.items():
            free = name
            while free in table:
                free = f"{Path(one.name).stem}.{free}"
            good = np.isfinite(values)
            table[free] = _at(rows_s, rows.step_s, one.stamps_s[good], values[good], one.step_s)
    content = BytesIO()
    csv.write_csv(pa.table({name: pa.array(values, from_pandas=True) for name, values in table.items()}), content)
    joined.parent.mkdir(parents=True, exist_ok=True)
    write_text(joined, "".join(f"# {line}\n" for one in logs for line in one.told) + content.getvalue().decode())
    zones = [f"{one.name} by {shift_s / 3600.0:+g} h" for one, shift_s in zip(logs, shifts_s, strict=True) if shift_s]
    return (
        f"{joined}: {names} are taken for loggers of one run and joined by their "
        f"{'rows' if logs[0].numbered else 'stamps'}, at the {rows_s.size} rows of "
        f"{rows.name}{f'; clocks shifted: {listed(zones)}' if zones else ''}"
    )


def _read(path: Path, hints: FileHints) -> _Log:
    table = read_table(path)
    times = time_columns(table, labels_of(table))
    table = on_one_clock(table, labels_of(table)).table
    table = replace(table, columns=without_duplicates(table.columns).columns, lines=None)
    labels = labels_of(table)
    clock = find_clock(with_readme(table, hints.readme) if hints.readme else table, labels, hints.rate_hz)
    if not np.all(np.diff(clock.time_s) > 0.0) or clock.time_s.size < 2:
        raise InputError(f"{path}: its clock runs back, stands still or has one row; give a file in order of time")
    first_s, dated = 0.0, False
    if clock.time is not None:
        first_s = float(table.columns[clock.time.column][0]) * clock.time.seconds
        if (part := clock.time.fraction) is not None:
            first_s += part.seconds * float(table.columns[part.column][0])
        dated = clock.time.column in table.dates or first_s > _DATED_S
    channels = {
        name: scaled(table, name)
        for name, values in table.columns.items()
        if name not in {*clock.columns, *times} and np.isfinite(values).any() and not counts_rows(values)
    }
    wraps = {name: size for name, values in channels.items() if (size := wrap_range(values)) is not None}
    channels |= {name: unwrapped(channels[name], size) for name, size in wraps.items()}
    of_motion = (Quantity.POSITION, Quantity.VELOCITY, Quantity.EFFORT)
    of_rows = (Constant.PERIOD, Constant.RATE)
    return _Log(
        path.name,
        (first_s % DAY_S if dated else first_s) + clock.time_s,
        {_titled(name, table.units.get(name, "")): values for name, values in channels.items()},
        tuple(one.text for constant, one in table.constants.items() if constant not in of_rows),
        dated,
        any(labels[name].quantity in of_motion for name in channels),
        clock.time is None,
    )


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit and split_unit(name)[1] is None else name


def _zone(first: _Log, other: _Log) -> float:
    """Time [s] by which the clock of another logger is ahead: 0, or of another zone if both are dated."""
    if first.enough(other) or not (first.dated and other.dated):
        return 0.0
    return _ZONE_S * round(float(other.stamps_s[0] - first.stamps_s[0]) / _ZONE_S)


def _at(rows_s: FloatArray, row_s: float, stamps_s: FloatArray, values: FloatArray, step_s: float) -> FloatArray:
    """Values (n,) of a logger at rows (m,), the mean over a row if the logger is faster; NaN in its gaps."""
    found = np.interp(rows_s, stamps_s, values)
    if row_s >= 2.0 * step_s:
        ends_s = np.clip(rows_s[:, None] + 0.5 * row_s * np.array([-1.0, 1.0]), stamps_s[0], stamps_s[-1])
        areas = np.diff(stamps_s) * 0.5 * (values[1:] + values[:-1])
        inside = np.interp(ends_s, stamps_s, np.concatenate([[0.0], np.cumsum(areas)]))
        width_s = np.diff(ends_s, axis=1)[:, 0]
        found = np.where(width_s > 0.0, np.diff(inside, axis=1)[:, 0] / np.maximum(width_s, 1e-300), found)
    after = np.clip(np.searchsorted(stamps_s, rows_s), 1, stamps_s.size - 1)
    lost = stamps_s[after] - stamps_s[after - 1] > _GAP * max(step_s, row_s)
    near = np.minimum(abs(rows_s - stamps_s[after]), abs(rows_s - stamps_s[after - 1])) < 0.5 * row_s
    return np.where(lost & ~near, np.nan, found)
