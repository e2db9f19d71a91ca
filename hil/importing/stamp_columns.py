"""One column of stamps: its unit, its digits, its range, and the fraction of a second in another column."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hil.arrays import FloatArray
from hil.importing.column_names import Label
from hil.importing.map_file import SECONDS, TimeColumn
from hil.recording.stamps import GAP_STEPS, REPEATS

SLOWEST_HZ, FASTEST_HZ = 5.0, 2e5  # of recordings of an axis: outside lies a wrong unit of the stamps
SLOWEST_TOLD_HZ = 2.0  # with a unit in the name
_SAME = 0.02  # relative deviation of a clock from another one of the same rows
_FORWARDS = 0.5  # of the way of stamps: less is no clock
_SHARED = 0.5  # different stamps of whole seconds for each row; a slower recording is none
_UNEVEN = 3.0  # times the usual step, of nearly all stamps that are made of two columns; others are gaps
_NEARLY_ALL = 0.99
# Seconds from the beginning of a clock's count to 1970: of Unix, of Windows (1601), of .NET (year 1).
_EPOCHS_S = {"s": (0.0,), "ms": (0.0,), "us": (0.0,), "ns": (0.0,), "100 ns": (11644473600.0, 62135596800.0)}
_YEAR_S = 365.25 * 86400.0
# Ranges of counters of time: of 16 to 32 bits, in their unit or as a number of larger ones; seconds of a day.
_RANGES = (86400.0, 86400e3, *(2.0**bits * per for bits in (15, 16, 24, 31, 32) for per in (1.0, 1e-3, 1e-6)))
_AGAIN = 0.25  # most rows of a counter that start again: of more the steps between rows are not known
_SINCE, _UNTIL = 30.0 * _YEAR_S, 130.0 * _YEAR_S  # 2000 to 2100


@dataclass(frozen=True, eq=False)
class Stamps:
    """Stamps (n,) [s]; `first` in the unit of the column; `sure` if the file says a unit that is one of a recording."""

    time: TimeColumn
    seconds: FloatArray
    first: float
    sure: bool

    @classmethod
    def of(cls, time: TimeColumn, stamps: FloatArray, sure: bool) -> Self:
        """Stamps of one column (n,) in its unit, from 0 where they count from long ago."""
        stamps = counted_on(stamps, time.wraps_at)
        good = stamps[np.isfinite(stamps)]
        start = float(good[0]) if good.size and time.unit != "date" else 0.0
        seconds = (stamps - start) * time.seconds
        step_s = float(np.ptp(seconds[np.isfinite(seconds)])) / max(good.size - 1, 1) if good.size else 0.0
        likely = time.unit == "date" or (step_s > 0.0 and SLOWEST_TOLD_HZ <= 1.0 / step_s <= FASTEST_HZ)
        return cls(time, seconds, start, sure and likely)

    @property
    def distinct(self) -> int:
        """Number of different stamps."""
        return int(np.unique(self.seconds).size)

    @property
    def span_s(self) -> float:
        return float(np.nanmax(self.seconds) - np.nanmin(self.seconds))

    @property
    def unevenness(self) -> float:
        """Median deviation of the steps from their median, as a share of it."""
        steps = np.diff(self.seconds)
        usual = float(np.median(steps))
        return float(np.median(np.abs(steps - usual))) / usual if usual > 0.0 else np.inf

    @property
    def digit_s(self) -> float:
        """Least step."""
        steps = np.diff(self.seconds)
        return float(np.min(steps[steps > 0.0], initial=self.span_s))


def range_of(stamps: FloatArray) -> float | None:
    """Range of a counter of time (n,) that starts again, such as 2^32; None where stamps fall by anything else.

    Over each fall, of more than half of it, it goes on by one step of the rows, or by some where rows are missing.
    """
    good = stamps[np.isfinite(stamps)]
    steps = np.diff(good)
    falls, rises = steps[steps < 0.0], steps[steps > 0.0]
    if not falls.size or falls.size > _AGAIN * steps.size or not rises.size:
        return None
    usual, span = float(np.median(rises)), float(np.ptp(good))
    least, most = -float(falls.max()), -float(falls.min())
    fitting = [size for size in _RANGES if max(span, most) < size < min(least + GAP_STEPS * usual, 2.0 * least)]
    return min(fitting, key=lambda size: abs(float(np.median(falls)) + size - usual), default=None)


def counted_on(stamps: FloatArray, size: float | None) -> FloatArray:
    """Stamps (n,) of a counter of a range `size` that starts again, without its falls; NaN stays."""
    if size is None:
        return stamps
    good = np.flatnonzero(np.isfinite(stamps))
    counted = stamps.copy()
    counted[good[1:]] += size * np.cumsum(np.diff(stamps[good]) < -0.5 * size)
    return counted


def growing(stamps: FloatArray) -> bool:
    """True for stamps (n,) that go forwards for most of their way; a fraction of a second begins again and again."""
    stamps = counted_on(stamps, range_of(stamps))
    steps = np.diff(stamps[np.isfinite(stamps)])
    return bool(steps.sum() > _FORWARDS * np.abs(steps).sum())


def whole_seconds(stamps: FloatArray) -> bool:
    """True for whole numbers (n,) that grow and are seconds since 1970 of this century."""
    whole = bool(np.isfinite(stamps).all() and np.all(stamps == np.round(stamps)) and np.ptp(stamps) > 0.0)
    return whole and bool(np.all((stamps > _SINCE) & (stamps < _UNTIL)) and np.all(np.diff(stamps) >= 0.0))


def since_1970(stamps: FloatArray) -> bool:
    """True for seconds (n,) of this century since 1970 that grow from row to row, also unevenly."""
    good = bool(np.isfinite(stamps).all() and np.all((stamps > _SINCE) & (stamps < _UNTIL)))
    return good and bool(np.all(np.diff(stamps) > 0.0))


def fraction_of(coarse: Stamps, name: str, values: FloatArray, told: Label) -> Stamps | None:
    """Stamps with the fraction of a second in another column (n,), which begins again with each second; else None."""
    ranges = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
    most = float(np.nanmax(values, initial=0.0))
    if np.nanmin(values, initial=0.0) < 0.0 or most <= 0.0 or coarse.time.unit not in ("date", "s"):
        return None
    shared = coarse.distinct < _SHARED * coarse.seconds.size
    if not shared or np.any(coarse.seconds != np.floor(coarse.seconds)):
        return None
    unit = told.unit if told.unit in ranges else next((one for one, size in ranges.items() if most < size), None)
    if unit is None or most >= ranges[unit]:
        return None
    seconds = coarse.seconds + SECONDS[unit] * values
    steps = np.diff(seconds)
    again = np.diff(values)[np.diff(coarse.seconds) > 0.0] < 0.0  # but for a gap
    if not growing(seconds) or steps.min() <= 0.0 or np.mean(again) <= 0.5:
        return None
    if np.quantile(steps, _NEARLY_ALL) > _UNEVEN * np.median(steps):
        return None
    part = TimeColumn(column=name, unit=unit)
    time = TimeColumn(column=coarse.time.column, unit=coarse.time.unit, scale=coarse.time.scale, fraction=part)
    return Stamps(time, seconds, 0.0, True)


def unit_of_stamps(
    stamps: Stamps, told: Label, known: list[Stamps], rate: tuple[float, str] | None
) -> tuple[Stamps, str]:
    """Stamps in the unit that another clock of the file, their age, or else their step tells, and a note if guessed."""
    raw = stamps.seconds / stamps.time.seconds
    steps = np.diff(raw)
    forward = steps[steps > 0.0]
    few_digits = np.mean(steps == 0.0) > REPEATS
    # without a step forwards there is no clock, which the rows then say
    step = float(forward.sum() / steps.size if few_digits else np.median(forward)) if forward.size else 1.0

    def in_unit(unit: str) -> Stamps:
        time = stamps.time.model_copy(update={"unit": unit, "scale": 1.0})
        return replace(stamps, time=time, seconds=raw * SECONDS[unit], sure=True)

    units = [unit for unit in SECONDS if unit != "date"]
    spans = [(one.span_s, one.digit_s, one.time.column) for one in known]
    spans += [((raw.size - 1) / rate[0], 0.0, rate[1])] if rate else []
    for span_s, digit_s, other in spans:
        span = float(np.ptp(raw))
        unit = min(units, key=lambda one: abs(np.log(max(span * SECONDS[one], 1e-12) / max(span_s, 1e-12))))
        if abs(span * SECONDS[unit] - span_s) <= _SAME * span_s + digit_s:
            return in_unit(unit), f"clock: {stamps.time.column} is in {unit} by its relation to {other}"
    for unit, starts in _EPOCHS_S.items():
        if any(_SINCE < stamps.first * SECONDS[unit] - start < _UNTIL for start in starts) and _is_rate(step, unit):
            return in_unit(unit), ""
    if rate is not None and told.unit is None:
        scaled = stamps.time.model_copy(update={"unit": "s", "scale": 1.0 / (rate[0] * step)})
        note = f"clock: the unit of {told.column!r} is not given; {rate[1]}, so that a step of {step:g} is one period"
        return replace(stamps, time=scaled, seconds=raw * scaled.scale, sure=True), note
    unit, note = unit_by_step(told, step, counts=bool(np.all(raw == np.round(raw))))
    return in_unit(unit), note


def _is_rate(step: float, unit: str) -> bool:
    return SLOWEST_HZ <= 1.0 / (step * SECONDS[unit]) <= FASTEST_HZ


def unit_by_step(told: Label, step: float, counts: bool = False) -> tuple[str, str]:
    """Unit of stamps with this step, and a note if it is guessed or if the name says another one.

    Whole numbers may be `counts` of any clock.
    """
    plausible = [unit for unit in ("s", "ms", "us", "ns", "d") if _is_rate(step, unit)]
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
    if len(plausible) == 1 and not counts:
        return best, ""
    return best, (
        f"clock: the unit of {told.column!r} is not given; {best} is taken (steps of {step:g} {best}); if it is "
        "another one, give the rows per second with --rate"
    )
