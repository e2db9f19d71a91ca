"""Find the clock of a foreign table: a column of time stamps with its unit, or a sampling rate."""

from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.importing.column_names import Label, Quantity, label
from hil.importing.foreign_table import ForeignTable
from hil.importing.header_values import Constant
from hil.importing.map_file import SECONDS
from hil.recording.stamps import GAP_STEPS, REPEATS

SLOWEST_HZ, FASTEST_HZ = 5.0, 2e5  # of recordings of an axis: outside lies a wrong unit of the stamps
_RATE_NAMES = (
    "fs",
    "rate",
    "sample_rate",
    "sampling_rate",
    "sample_rate_hz",
    "sampling_frequency",
    "fe",
    "fa",
    "abtastrate",
)
_PERIOD_NAMES = ("ts", "dt", "te", "ta", "period", "sample_time", "sampling_time", "period_s", "abtastzeit")


@dataclass(frozen=True, eq=False)
class StampClock:
    """A column with its unit, or a rate [Hz]; `time_s` (n,) from 0; `resample_hz` if its steps are irregular."""

    time_s: FloatArray
    column: str | None
    unit: str
    rate_hz: float | None
    resample_hz: float | None
    how: str
    unsure: tuple[str, ...] = ()


def find_clock(table: ForeignTable, labels: dict[str, Label], rate_hz: float | None) -> StampClock:
    """Find the clock. `rate_hz` is what the user says; it counts more than stamps.

    Raises InputError: no clock, stamps that run back or repeat, rows in a wrong order.
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
    return StampClock(np.arange(rows) / rate_hz, None, "s", rate_hz, None, how)


def _written_rate(table: ForeignTable) -> tuple[float, str] | None:
    for name, value in table.scalars.items():
        plain = name.lower()
        if plain in _RATE_NAMES and SLOWEST_HZ <= value <= FASTEST_HZ:
            return value, f"scalar {name} of the file"
        if plain in _PERIOD_NAMES and SLOWEST_HZ <= 1.0 / (value or 1e9) <= FASTEST_HZ:
            return 1.0 / value, f"scalar {name} of the file, as period in s"
    told = table.constants.get(Constant.RATE)
    return (told.value, f"header of the file: {told.text}") if told and SLOWEST_HZ <= told.value <= FASTEST_HZ else None


def _column(table: ForeignTable, labels: dict[str, Label]) -> str | None:
    """The column named as time; else the first that grows by nearly equal steps."""
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
    where = f"{table.path}: {column}"
    bad = np.flatnonzero(~np.isfinite(stamps))
    if bad.size:
        raise InputError(
            f"{where}: row {bad[0] + 1} of the numbers has no time stamp; correct the row or cut before it"
        )
    steps = np.diff(stamps)
    typical = float(np.median(steps))
    repeats, back = float(np.mean(steps == 0.0)), float(np.mean(steps < 0.0))
    if back > 0.0 or stamps[-1] == stamps[0]:
        _refuse_order(where, stamps, steps)
    unsure = []
    gaps = np.any(steps > GAP_STEPS * np.median(steps[steps > 0.0]))
    if repeats > REPEATS and not gaps:
        unit = "date" if column in table.dates else _unit(told, float(np.mean(steps)))[0]
        rate = (stamps.size - 1) / (float(stamps[-1] - stamps[0]) * SECONDS[unit])
        unsure.append(
            f"clock: {100 * repeats:.0f} % of the stamps in {column!r} repeat (too few digits); "
            f"equal steps at {rate:.6g} Hz are taken instead"
        )
        return StampClock(
            np.arange(stamps.size) / rate, None, "s", float(f"{rate:.6g}"), None, f"mean of {column}", tuple(unsure)
        )
    if 0.0 < repeats <= REPEATS:
        row = int(np.flatnonzero(steps == 0.0)[0]) + 2
        raise InputError(
            f"{where}: row {row} of the numbers repeats the stamp of the row before; remove the duplicate row"
        )
    if column in table.dates:
        unit = "date"
    else:
        unit, note = _unit(told, typical or float(np.mean(steps)))
        unsure += [note] if note else []
    how = "by its name" if told.quantity is Quantity.TIME else "grows by equal steps"
    return StampClock((stamps - stamps[0]) * SECONDS[unit], column, unit, None, None, how, tuple(unsure))


def _unit(told: Label, step: float) -> tuple[str, str]:
    """Unit of the stamps, and a note where it is a guess or contradicts the name."""
    plausible = [
        unit for unit in ("s", "ms", "us", "ns", "d") if SLOWEST_HZ <= 1.0 / (step * SECONDS[unit]) <= FASTEST_HZ
    ]
    if told.unit in plausible or (told.unit is not None and not plausible):
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


def _refuse_order(where: str, stamps: FloatArray, steps: FloatArray) -> None:
    sorted_steps = np.diff(np.sort(stamps))
    regular = np.mean(np.abs(sorted_steps - np.median(sorted_steps)) < 0.05 * np.median(sorted_steps)) > 0.9
    row = int(np.flatnonzero(steps < 0.0)[0]) + 2 if (steps < 0.0).any() else 1
    backward = int(np.sum(steps < 0.0))
    if not (steps != 0.0).any():
        raise InputError(
            f"{where}: the stamps are all {stamps[0]:g}; say the rate of the rows: hil import FILE --rate HZ"
        )
    if regular and backward > max(3, stamps.size // 100):
        raise InputError(
            f"{where}: the rows are out of order, in {backward} places time runs back; sort the file by "
            f"{where.rsplit(': ', 1)[-1]}"
        )
    raise InputError(
        f"{where}: time runs back at row {row} of the numbers, from {stamps[row - 2]:g} to {stamps[row - 1]:g}: two "
        "recordings in one file, or rows out of order; cut the file there, or sort it"
    )
