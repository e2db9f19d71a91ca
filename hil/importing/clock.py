"""Find the clock of a foreign table: all columns that may be time are read and compared; else a sampling rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.errors import RateNeeded
from hil.importing.column_names import Label, label
from hil.importing.foreign_table import ForeignTable
from hil.importing.lexicon import Constant, Quantity, lexicon
from hil.importing.map_file import SECONDS, TimeColumn
from hil.importing.row_counters import counts_rows
from hil.importing.stamp_columns import (
    FASTEST_HZ,
    SLOWEST_HZ,
    Stamps,
    counted_on,
    fraction_of,
    growing,
    range_of,
    since_1970,
    unit_of_stamps,
    whole_seconds,
)

SAME = 0.01  # relative deviation of two clocks of the same rows
_RATE_UNITS = {"hz": 1.0, "khz": 1e3}
_INTERVAL = 0.01  # relative deviation of the intervals of an even clock


@dataclass(frozen=True, eq=False)
class StampClock:
    """A column with its unit, or a rate [Hz]; `time_s` (n,) from 0, not yet regular."""

    time_s: FloatArray
    time: TimeColumn | None
    rate_hz: float | None
    how: str
    unsure: tuple[str, ...] = ()

    @property
    def columns(self) -> set[str]:
        """Columns of the stamps."""
        parts = [self.time, self.time.fraction] if self.time else []
        return {part.column for part in parts if part}


def find_clock(table: ForeignTable, labels: dict[str, Label], rate_hz: float | None) -> StampClock:
    """Find the clock. `rate_hz`, the rate that the user gives, overrules columns of stamps.

    Raises InputError: no clock, or a row without a stamp.
    """
    if rate_hz is not None:
        return _of_rate(table, labels, rate_hz, "given with --rate")
    told = _written_rate(table)
    named = time_columns(table, labels)
    grow = [name for name in named or _unnamed(table, labels, told is None) if growing(table.columns[name])]
    if found := clock_of(table, labels, grow, told):
        return found
    even = [rate for name in named if (rate := _of_intervals(table, labels, name))]
    if even or told:
        return _of_rate(table, labels, *(even[0] if even else told or (0.0, "")))
    # rows out of order make no clock of any column; they are refused by what is named one
    if found := clock_of(table, labels, named[:1], told):
        return found
    text = next((remark for remark in table.remarks if label(remark.split(":")[0]).quantity is Quantity.TIME), None)
    raise RateNeeded(
        f"{table.path}: no column of time stamps is found{f' ({text})' if text else ''}, and no line above the rows "
        "tells their rate or period"
    )


def time_columns(table: ForeignTable, labels: dict[str, Label]) -> list[str]:
    """Columns of time by their names, and those of dates."""
    return [name for name in table.columns if labels[name].quantity is Quantity.TIME or name in table.dates]


def clock_of(
    table: ForeignTable, labels: dict[str, Label], names: Sequence[str], told: tuple[float, str] | None
) -> StampClock | None:
    """The clock that the columns `names` make, of which the others only tell the unit; None without names.

    The one with most different stamps counts, of equal ones that with the most even steps; a column of fractions of a
    second is added to one of whole seconds.
    `told` is the rate [Hz] that the file gives elsewhere, with its source.
    """
    stamps = [_stamps(table, labels, name) for name in names]
    others = [name for name, one in labels.items() if one.quantity in (Quantity.TIME, Quantity.UNKNOWN)]
    for name in others:
        if name in table.columns and name not in [one.time.column for one in stamps]:
            stamps += [both for one in stamps if (both := fraction_of(one, name, table.columns[name], labels[name]))]
    if not stamps:
        return None
    known = [one for one in stamps if one.sure]
    best = max(stamps, key=lambda one: (one.distinct, one.sure, -round(one.unevenness, 3)))
    _refuse_missing(table, best)
    note = ""
    if not best.sure:
        best, note = unit_of_stamps(best, labels[best.time.column], known, told)
    notes = [note] if note else []
    if (size := best.time.wraps_at) is not None:
        notes.append(
            f"clock: {best.time.column} starts again at {size:.10g}; it is counted on, which is right if no step "
            f"between two rows is as long as {size * best.time.seconds:.4g} s"
        )
    for one in known:
        if one.time.column not in (best.time.column, best.time.fraction and best.time.fraction.column):
            off = abs(one.span_s - best.span_s)
            if off > SAME * best.span_s + one.digit_s + best.digit_s:
                notes.append(
                    f"clock: {one.time.column} runs {one.span_s:.6g} s and {best.time.column} {best.span_s:.6g} s over "
                    f"the same rows; {best.time.column} is taken"
                )
    step_s = best.span_s / max(best.seconds.size - 1, 1)
    if told is not None and step_s > 0.0 and abs(step_s * told[0] - 1.0) > 2.0 * SAME:
        notes.append(f"clock: {told[1]}, but the stamps of {best.time.column} step by {step_s:.6g} s; they are taken")
    by_name = labels[best.time.column].quantity is Quantity.TIME or best.time.unit == "date"
    how = "by its name" if by_name else "grows by equal steps"
    return StampClock(best.seconds - best.seconds[0], best.time, None, how, tuple(notes))


def _of_intervals(table: ForeignTable, labels: dict[str, Label], name: str) -> tuple[float, str] | None:
    """Rate of a column of time that holds the interval of each row, all equal, in a unit that the file says."""
    values = table.columns[name] * SECONDS.get(labels[name].unit or "", 0.0)
    usual = float(np.median(values[1:]))
    even = usual > 0.0 and name not in table.dates and bool(np.all(np.abs(values[1:] - usual) < _INTERVAL * usual))
    return (1.0 / usual, f"intervals in the column {name}") if even and _plausible(1.0 / usual) else None


def _stamps(table: ForeignTable, labels: dict[str, Label], name: str) -> Stamps:
    unit, stamps = "date" if name in table.dates else labels[name].unit, table.columns[name]
    scale, wraps_at = table.scales.get(name, (1.0, 0.0))[0], None if unit == "date" else range_of(stamps)
    time = TimeColumn(column=name, unit=unit or "s", scale=scale, wraps_at=wraps_at)
    return Stamps.of(time, stamps, unit is not None)


def _unnamed(table: ForeignTable, labels: dict[str, Label], timed: bool) -> list[str]:
    """The first column without a known quantity that grows by nearly equal steps, or holds seconds since 1970.

    `timed`: also one whose name has a unit of time and tells another quantity, such as cycle_us. Row numbers are none.
    """
    for name, values in table.columns.items():
        steps, in_time = np.diff(counted_on(values, range_of(values))), labels[name].unit in SECONDS
        if labels[name].quantity is Quantity.UNKNOWN and (whole_seconds(values) or since_1970(values)):
            return [name]
        if (
            (labels[name].quantity is Quantity.UNKNOWN or labels[name].letter or (timed and in_time))
            and steps.size
            and np.isfinite(steps).all()
            and steps.min() > 0
        ):
            row_numbers = counts_rows(values) and values[0] in (0.0, 1.0) and not in_time
            if np.ptp(steps) < 0.2 * np.median(steps) and not row_numbers:
                return [name]
    return []


def _refuse_missing(table: ForeignTable, stamps: Stamps) -> None:
    bad = np.flatnonzero(~np.isfinite(stamps.seconds))
    if bad.size:
        line, text = table.texts.get(stamps.time.column, (0, "an empty field"))
        place = f"{table.path}:{line}" if line else table.place(int(bad[0]))
        raise RateNeeded(
            f"{place}: {stamps.time.column}: the row has no time stamp: given {text!r}; import the part of the "
            "file before it"
        )


def _of_rate(table: ForeignTable, labels: dict[str, Label], rate_hz: float, how: str) -> StampClock:
    """Clock of equal rows; a column that numbers them tells where some are missing."""
    for name, values in table.columns.items():
        if labels[name].quantity is not Quantity.TIME and counts_rows(values) and np.diff(values).max() > 1.0:
            time = TimeColumn(column=name, unit="s", scale=1.0 / rate_hz)
            note = f"clock: {name} numbers the rows; where it steps by more than 1, rows are missing"
            return StampClock((values - values[0]) / rate_hz, time, None, f"numbers of the rows, {how}", (note,))
    rows = next(iter(table.columns.values())).size
    return StampClock(np.arange(rows) / rate_hz, None, rate_hz, how)


def _plausible(rate_hz: float) -> bool:
    return SLOWEST_HZ <= rate_hz <= FASTEST_HZ


def _written_rate(table: ForeignTable) -> tuple[float, str] | None:
    """Rate [Hz] that the file gives beside its columns, with its source: a line or a scalar."""
    told = table.constants.get(Constant.RATE)
    if told and _plausible(told.value):
        return told.value, f"period from the line {told.text!r}"
    holders = {name.rpartition(".")[0] for name in table.columns}  # a rate beside the signals is theirs
    for name, value in sorted(table.scalars.items(), key=lambda one: one[0].rpartition(".")[0] not in holders):
        plain = name.rpartition(".")[2].lower()
        stem, _, unit = plain.rpartition("_")
        if stem in lexicon().scalars.rate and unit in _RATE_UNITS:
            plain, value = stem, _RATE_UNITS[unit] * value
        if plain in lexicon().scalars.rate and _plausible(value):
            return value, f"scalar {name} of the file"
        if plain in lexicon().scalars.period and _plausible(1.0 / (value or 1e9)):
            return 1.0 / value, f"scalar {name} of the file, as period in s"
    return None
