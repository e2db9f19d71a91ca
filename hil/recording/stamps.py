"""Give rows a regular clock: cut them at gaps, replace jittering stamps, interpolate missing rows; notes say so."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError, RateNeeded
from hil.files.input_file import MOST_VALUES
from hil.recording.clock_notes import LEAST_ROWS, of_gaps, of_ticks, of_uneven
from hil.recording.row_clock import (
    CLOCK_TOLERANCE,
    RowClock,
    Ticks,
    at_whole_periods,
    rounded_ticks,
    row_clock,
    row_ticks,
    slope,
)

LARGEST = 1e12  # above every SI value of a channel, and of a clock in microseconds per day
LEAST_STEP_S = 1e-9  # periods are rounded to 1 ps
GAP_STEPS = 10.0  # of the clock: above, rows are missing and are not interpolated
REPEATS = 0.02  # share of repeated stamps from which they have too few digits, and are no duplicate rows
_TENTHS = 200  # steps from which the median of a tenth is a typical step in spite of jitter
_TWO_RATES = 1.5  # ratio of typical steps at both ends: more than jitter and drift


@dataclass(frozen=True)
class PartStart:
    """First row of a part without gaps, and its time since the first row of the file [s]."""

    row: int
    time_s: float


@dataclass(frozen=True, eq=False)
class RegularRows:
    """Columns (n,) whose `time_s` has one period in each part; `rate_hz` if they are interpolated to it."""

    columns: dict[str, FloatArray]
    period_s: float
    parts: tuple[PartStart, ...]
    rate_hz: float | None
    notes: tuple[str, ...]

    @property
    def pieces(self) -> list[slice]:
        """Rows of each part."""
        edges = [*(part.row for part in self.parts), self.columns["time_s"].size]
        return [slice(first, end) for first, end in pairwise(edges)]

    def longest_part(self) -> dict[str, FloatArray]:
        """Columns (m,) of the part with most rows, without the time."""
        piece = max(self.pieces, key=lambda one: one.stop - one.start)
        return {name: values[piece] for name, values in self.columns.items() if name != "time_s"}


def check_finite(columns: Mapping[str, FloatArray], place: Callable[[int], str]) -> None:
    """Raise InputError at the first NaN, infinity or number beyond LARGEST.

    `place` gives the place of row i (from 0), such as "file:line".
    """
    for name, values in columns.items():
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if bad.size:
            row = int(bad[0])
            raise InputError(
                f"{place(row)}: {name}: given {values[row]}, allowed a finite number up to {LARGEST:g}; "
                "correct the value or cut the recording before it"
            )


def regular_rows(
    columns: Mapping[str, FloatArray],
    place: Callable[[int], str],
    rate_hz: float | None = None,
    judged_by: Collection[str] = (),
    period_s: float | None = None,
) -> RegularRows:
    """Cut columns (n,) at gaps of their `time_s` and give each part equal steps.

    Stamps that are regular within 1 % stay as they are, single missing rows are interpolated; stamps with too few
    digits get equal steps. Else either the stamps jitter and the rows are equal ticks, or the rows were taken at these
    times: the motion tells (`row_clock`), in the columns `judged_by`, by default all. Equal ticks are numbered, not
    interpolated; rows taken at uneven times are interpolated, to `rate_hz` or that of the typical step. A `rate_hz`
    within 1 % of that of equal ticks asks for nothing. `period_s` of the ticks, if it is known: rows of a loop that
    was late lie at whole multiples of it.

    `place` as in `check_finite`. Raises InputError: NaN, time that repeats or runs back, two rates, too few rows
    to tell the clock (with `period_s` three are enough).
    """
    check_finite(columns, place)
    time_s = columns["time_s"]
    if time_s.size < 3:
        raise InputError(f"{place(0)}: time_s: given {time_s.size} rows, allowed 3 or more; give a longer recording")
    steps = np.diff(time_s)
    few_digits = bool(time_s.size >= LEAST_ROWS and np.mean(steps == 0.0) > REPEATS and steps.max() > 0.0)
    _refuse_order(time_s, steps, few_digits, place)
    typical = float(np.median(steps[steps > 0.0]))
    if typical < LEAST_STEP_S:
        raise InputError(
            f"{place(0)}: time_s: given steps of {typical:.3g} s, allowed {LEAST_STEP_S:g} s or more; correct the unit "
            "of the time in the map"
        )
    at_ticks = bool(period_s and period_s > 0.0 and at_whole_periods(steps, period_s) and steps.min() < 1.5 * period_s)
    if period_s is not None and at_ticks:
        typical = period_s
    elif not few_digits:
        _refuse_two_rates(steps, place)
    first = np.r_[0, np.flatnonzero(steps > GAP_STEPS * typical) + 1]
    pieces = [slice(int(a), int(b)) for a, b in zip(first, np.r_[first[1:], time_s.size], strict=True)]
    kept = [piece for piece in pieces if len(pieces) == 1 or piece.stop - piece.start >= LEAST_ROWS]
    within = np.concatenate([steps[piece.start : piece.stop - 1] for piece in kept] or [np.empty(0)])
    # rounded to 1 ps: the mean of printed stamps is a period with rounding errors
    even = bool(within.size and np.all(np.abs(within - typical) <= CLOCK_TOLERANCE * round(typical, 12)))
    if not kept or (not even and not at_ticks and time_s.size < LEAST_ROWS):
        row = int(np.flatnonzero(np.abs(steps - typical) > CLOCK_TOLERANCE * typical)[0]) + 1
        raise InputError(
            f"{place(row)}: time_s: a step of {steps[row - 1]:.6g} s, allowed the period "
            f"{typical:.6g} s +-1 %; rows are missing: cut the recording there, or resample it"
        )
    notes = of_gaps(time_s, pieces, kept, typical)
    mean_s = float(np.sum(within) / within.size)
    if even and (rate_hz is None or _near(1.0 / rate_hz, mean_s)):
        parts = [{name: values[piece] for name, values in columns.items()} for piece in kept]
        return _joined(parts, time_s[0], round(mean_s, 12), None, notes)
    if few_digits:
        ticks: list[Ticks] = [np.arange(piece.stop - piece.start) for piece in kept]
        times = [time_s[piece] for piece in kept]
        rounded = rounded_ticks(times)
        period_s = rounded.period_s if rounded else slope(times, ticks)
        error = f" +- {rounded.error_s:.1g} s" if rounded else ""
        notes = (*notes, f"clock: stamps repeat (too few digits); equal steps of {period_s:.6g} s{error} are taken")
        return _joined(_at_ticks(columns, kept, ticks, period_s), time_s[0], period_s, None, notes)
    judged = {name: columns[name] for name in judged_by or columns} | {"time_s": time_s}
    clock, told = row_clock(judged, kept, typical)
    if clock is None:
        period_s = _usual_step(time_s, kept, within, typical) if rate_hz is None else 1.0 / rate_hz
        notes = (*notes, of_uneven(within, typical, told, 1.0 / period_s))
    else:
        columns = _at_their_ticks(columns, kept, clock)
        whole_rate = rate_hz is None or _near(1.0 / rate_hz, clock.period_s)
        period_s = clock.period_s if rate_hz is None or whole_rate else 1.0 / rate_hz
        notes = (*notes, *of_ticks(clock, None if whole_rate else rate_hz))
        if whole_rate:
            filled_hz = float(f"{1.0 / period_s:.9g}") if clock.missing else None
            return _joined(_at_ticks(columns, kept, clock.ticks, period_s), time_s[0], period_s, filled_hz, notes)
    rate_hz = float(f"{1.0 / period_s:.9g}")
    span_s = sum(float(time_s[piece.stop - 1] - time_s[piece.start]) for piece in kept)
    _refuse_many(int(span_s * rate_hz), len(columns), rate_hz)
    parts = [_interpolated(columns, piece, rate_hz) for piece in kept]
    return _joined(parts, time_s[0], round(1.0 / rate_hz, 12), rate_hz, notes)


def _near(step_s: float, period_s: float) -> bool:
    return abs(step_s - period_s) <= CLOCK_TOLERANCE * period_s


def _usual_step(time_s: FloatArray, kept: list[slice], within: FloatArray, typical: float) -> float:
    """Step of uneven rows, of four digits: that which most have, else the mean of those where no row is missing."""
    most = np.mean(np.abs(within - typical) <= CLOCK_TOLERANCE * typical) > 0.5
    times = [time_s[piece] for piece in kept]
    return float(f"{typical if most else slope(times, [row_ticks(one) for one in times]):.4g}")


def _at_their_ticks(columns: Mapping[str, FloatArray], kept: list[slice], clock: RowClock) -> dict[str, FloatArray]:
    """Columns (n,) whose `time_s` is that of the ticks; parts begin at whole ticks since the first row."""
    time_s = columns["time_s"].copy()
    begin_s, period_s = time_s[0], clock.period_s
    for piece, ticks in zip(kept, clock.ticks, strict=True):
        first = round(float(time_s[piece.start] - begin_s) / period_s)
        time_s[piece] = begin_s + (first + ticks) * period_s
    return {**columns, "time_s": time_s}


def _refuse_order(time_s: FloatArray, steps: FloatArray, few_digits: bool, place: Callable[[int], str]) -> None:
    bad = np.flatnonzero(steps < 0.0 if few_digits else steps <= 0.0)
    if not bad.size:
        return
    row, back = int(bad[0]) + 1, int(np.sum(steps < 0.0))
    advice = "remove the row, or import the file with a sample rate"
    falls, usual = steps[steps < 0.0], float(np.median(np.abs(steps)))
    again = back > 1 and np.ptp(falls) < GAP_STEPS * usual and -falls.max() > GAP_STEPS * usual
    if time_s.min() == time_s.max():
        raise RateNeeded(f"{place(row)}: the stamps are all {time_s[0]:g} s")
    if not steps[row - 1]:
        problem = "repeats (a duplicate row, or stamps with too few digits)"
    elif again:
        problem = f"runs back by {-np.median(falls):.6g} s in {back} places"
        advice = "if it is a counter that starts again, write its range into a map: time.wraps_at"
    elif back > max(3, time_s.size // 100):
        problem = f"runs back in {back} places, the rows are out of order or the clock was set"
        advice = "sort rows that were shuffled by their time; where the clock was set the times are lost: record again"
    else:
        problem = "runs back"
        advice = "two recordings in one file, or a clock that was set: cut the file there"
    raise InputError(
        f"{place(row)}: time_s: {problem}: given {time_s[row]:.9g} s after {time_s[row - 1]:.9g} s, "
        f"allowed a growing time; {advice}"
    )


def _refuse_two_rates(steps: FloatArray, place: Callable[[int], str]) -> None:
    """Refuse a clock whose step changes for good: two recordings of different rate in one file."""
    if steps.size < _TENTHS:
        return
    tenth = steps.size // 10
    first, last = float(np.median(steps[:tenth])), float(np.median(steps[-tenth:]))
    if max(first, last) > _TWO_RATES * min(first, last):
        row = int(np.flatnonzero(np.abs(steps - first) > 0.25 * abs(last - first))[0]) + 1
        raise InputError(
            f"{place(row - 1)}: two sampling rates in one file, steps of {first:.4g} s first and {last:.4g} s at "
            "the end; cut the file there and import the parts"
        )


def _at_ticks(
    columns: Mapping[str, FloatArray], kept: list[slice], ticks: list[Ticks], period_s: float
) -> list[dict[str, FloatArray]]:
    """The rows of each part at each of its ticks, linear where rows are missing."""
    parts = []
    _refuse_many(sum(int(at[-1]) + 1 for at in ticks), len(columns), 1.0 / period_s)
    for piece, at in zip(kept, ticks, strict=True):
        grid = np.arange(at[-1] + 1)
        part = {name: np.interp(grid, at, values[piece]) for name, values in columns.items()}
        parts.append(part | {"time_s": columns["time_s"][piece.start] + grid * period_s})
    return parts


def _interpolated(columns: Mapping[str, FloatArray], piece: slice, rate_hz: float) -> dict[str, FloatArray]:
    """The rows of a part, linear between them."""
    time_s = columns["time_s"][piece]
    # the last row counts although its time may be rounded down
    rows = int((time_s[-1] - time_s[0]) * rate_hz + 1e-6) + 1
    grid_s = time_s[0] + np.arange(rows) / rate_hz
    return {name: np.interp(grid_s, time_s, values[piece]) for name, values in columns.items()} | {"time_s": grid_s}


def _refuse_many(rows: int, columns: int, rate_hz: float) -> None:
    if rows * columns > MOST_VALUES:
        raise InputError(
            f"time_s: given stamps that need {rows} rows of {columns} channels at {rate_hz:.6g} Hz, allowed "
            f"{MOST_VALUES} values together; cut the recording, or resample it to a lower rate"
        )


def _joined(
    parts: list[dict[str, FloatArray]],
    begin_s: float,
    period_s: float,
    rate_hz: float | None,
    notes: tuple[str, ...],
) -> RegularRows:
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rows = np.r_[0, np.cumsum([part["time_s"].size for part in parts])]
    starts = (PartStart(int(row), float(part["time_s"][0] - begin_s)) for row, part in zip(rows, parts, strict=False))
    return RegularRows(columns, period_s, tuple(starts), rate_hz, notes)
