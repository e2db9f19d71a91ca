"""Find the clock of a foreign table: a column of time stamps with its unit, or a sampling rate."""

from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.importing.column_names import Label, label
from hil.importing.foreign_table import ForeignTable
from hil.importing.lexicon import Constant, Quantity, lexicon
from hil.importing.map_file import SECONDS
from hil.recording.stamps import REPEATS

SLOWEST_HZ, FASTEST_HZ = 5.0, 2e5  # of recordings of an axis: outside lies a wrong unit of the stamps

SLOWEST_TOLD_HZ = 2.0  # with a unit in the name


@dataclass(frozen=True, eq=False)
class StampClock:
    """A column with its unit, or a rate [Hz]; `time_s` (n,) from 0, not yet regular."""

    time_s: FloatArray
    column: str | None
    unit: str
    rate_hz: float | None
    how: str
    unsure: tuple[str, ...] = ()


def find_clock(table: ForeignTable, labels: dict[str, Label], rate_hz: float | None) -> StampClock:
    """Find the clock. `rate_hz`, the rate that the user gives, overrules a column of stamps.

    Raises InputError: no clock, or a row without a stamp.
    """
    rows = len(next(iter(table.columns.values())))
    if rate_hz is not None:
        return _of_rate(rows, rate_hz, "given with --rate")
    column = _column(table, labels)
    if column is None:
        found = _written_rate(table)
        if found is None:
            text = next((remark for remark in table.remarks if _says_time(remark)), None)
            raise InputError(
                f"{table.path}: no column of time stamps is found"
                + (f" ({text})" if text else "")
                + ", allowed one in seconds or a known rate; say the rate of the rows: hil import FILE --rate HZ"
            )
        return _of_rate(rows, *found)
    return _of_column(table, column, labels[column])


def _says_time(remark: str) -> bool:
    return label(remark.split(":")[0]).quantity is Quantity.TIME


def _of_rate(rows: int, rate_hz: float, how: str) -> StampClock:
    return StampClock(np.arange(rows) / rate_hz, None, "s", rate_hz, how)


def _written_rate(table: ForeignTable) -> tuple[float, str] | None:
    for name, value in table.scalars.items():
        plain = name.lower()
        if plain in lexicon().scalars.rate and SLOWEST_HZ <= value <= FASTEST_HZ:
            return value, f"scalar {name} of the file"
        if plain in lexicon().scalars.period and SLOWEST_HZ <= 1.0 / (value or 1e9) <= FASTEST_HZ:
            return 1.0 / value, f"scalar {name} of the file, as period in s"
    told = table.constants.get(Constant.RATE)
    return (told.value, f"header of the file: {told.text}") if told and SLOWEST_HZ <= told.value <= FASTEST_HZ else None


def _column(table: ForeignTable, labels: dict[str, Label]) -> str | None:
    """Column of stamps: one that is named so, else the first that grows by nearly equal steps; None without one."""
    named = [name for name in table.columns if labels[name].quantity is Quantity.TIME or name in table.dates]
    if named:
        return max(named, key=lambda name: _growing(table.columns[name]))
    for name, values in table.columns.items():
        steps = np.diff(values)
        if labels[name].quantity is Quantity.UNKNOWN and steps.size and np.isfinite(steps).all() and steps.min() > 0:
            row_numbers = bool(np.all(steps == 1.0) and values[0] in (0.0, 1.0))
            if np.ptp(steps) < 0.2 * np.median(steps) and not row_numbers:
                return name
    return None


def _growing(values: FloatArray) -> float:
    return float(np.mean(np.diff(values) > 0))


def _of_column(table: ForeignTable, column: str, told: Label) -> StampClock:
    stamps = table.columns[column]
    bad = np.flatnonzero(~np.isfinite(stamps))
    if bad.size:
        raise InputError(
            f"{table.path}: {column}: row {bad[0] + 1} of the numbers has no time stamp; correct the row, or cut the "
            "file before it"
        )
    if column in table.dates:
        unit, note = "date", ""
    else:
        steps = np.diff(stamps)
        forward = steps[steps > 0.0]
        few_digits = np.mean(steps == 0.0) > REPEATS
        # without a step forwards there is no clock, which the rows then say
        step = float(forward.sum() / steps.size if few_digits else np.median(forward)) if forward.size else 1.0
        unit, note = _unit(told, step)
    how = "by its name" if told.quantity is Quantity.TIME else "grows by equal steps"
    time_s = (stamps - stamps[0]) * SECONDS[unit]
    return StampClock(time_s, column, unit, None, how, (note,) if note else ())


def _unit(told: Label, step: float) -> tuple[str, str]:
    """Unit of stamps with this step, and a note if it is guessed or if the name says another one."""
    plausible = [
        unit for unit in ("s", "ms", "us", "ns", "d") if SLOWEST_HZ <= 1.0 / (step * SECONDS[unit]) <= FASTEST_HZ
    ]
    slow = told.unit is not None and SLOWEST_TOLD_HZ <= 1.0 / (step * SECONDS[told.unit]) < SLOWEST_HZ
    if slow or told.unit in plausible or (told.unit is not None and not plausible):
        return str(told.unit), ""
    # of seconds, milliseconds, ... the one with the rate nearest to 1 kHz, the usual one of a servo drive
    best = min(plausible or ["s"], key=lambda unit: abs(np.log(step * SECONDS[unit] / 1e-3)))
    if told.unit is not None:
        return best, (
            f"clock: {told.column!r} says {told.unit}, but steps of {step:g} {told.unit} are no rate of a recording; "
            f"{best} is taken"
        )
    if len(plausible) == 1:
        return best, ""
    return best, f"clock: the unit of {told.column!r} is not given; {best} is taken (steps of {step:g} {best})"
