"""Give rows a regular clock: cut them at gaps, replace jittering stamps, interpolate missing rows; notes say so."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
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
GAP_STEPS = 10.0  # of the clock: above, rows are missing and are not interpolated
LEAST_ROWS = 50  # of a part: fewer show no motion
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
    notes = _of_gaps(time_s, pieces, kept, typical)
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
        notes = (*notes, _of_uneven(within, typical, told, 1.0 / period_s))
    else:
        columns = _at_their_ticks(columns, kept, clock)
        whole_rate = rate_hz is None or _near(1.0 / rate_hz, clock.period_s)
        period_s = clock.period_s if rate_hz is None or whole_rate else 1.0 / rate_hz
        notes = (*notes, *_of_ticks(clock, None if whole_rate else rate_hz))
        if whole_rate:
            filled_hz = float(f"{1.0 / period_s:.9g}") if clock.missing else None
            return _joined(_at_ticks(columns, kept, clock.ticks, period_s), time_s[0], period_s, filled_hz, notes)
    rate_hz = float(f"{1.0 / period_s:.9g}")
    parts = [_interpolated(columns, piece, rate_hz) for piece in kept]
    return _joined(parts, time_s[0], round(1.0 / rate_hz, 12), rate_hz, notes)


def _near(step_s: float, period_s: float) -> bool:
    return abs(step_s - period_s) <= CLOCK_TOLERANCE * period_s


def _usual_step(time_s: FloatArray, kept: list[slice], within: FloatArray, typical: float) -> float:
    """Step of uneven rows, of four digits: that which most have, else the mean of those where no row is missing."""
    most = np.mean(np.abs(within - typical) <= CLOCK_TOLERANCE * typical) > 0.5
    times = [time_s[piece] for piece in kept]
    return float(f"{typical if most else slope(times, [row_ticks(one) for one in times]):.4g}")


def _of_uneven(within: FloatArray, typical: float, told: bool, rate_hz: float) -> str:
    """Note on rows that are interpolated by their stamps."""
    doubt = "" if told else ", and the motion does not tell whether the rows are equal ticks"
    return (
        f"clock: the steps of the stamps are uneven, typically {span_text(typical)}, from {span_text(within.min())} to "
        f"{span_text(within.max())}{doubt}; the channels are interpolated by the stamps to {rate_hz:.6g} Hz"
    )


def _of_ticks(clock: RowClock, rate_hz: float | None) -> tuple[str, ...]:
    """Notes on rows that are counted: jitter of the stamps, missing rows, and another rate that the map wants."""
    notes, missing = [], clock.missing
    if clock.rounded is not None:
        notes.append(
            f"clock: the stamps are rounded to {span_text(clock.rounded.digit_s)}; by all of them rows are equal ticks "
            f"of {span_text(clock.period_s)} +- {span_text(clock.rounded.error_s)}"
        )
    elif clock.jitter_s > CLOCK_TOLERANCE * clock.period_s:
        notes.append(
            f"clock: the stamps jitter by {span_text(clock.jitter_s)}, but the rows are equal ticks of "
            f"{span_text(clock.period_s)}: the row number is the clock"
        )
    if missing:
        notes.append(
            f"clock: {sum(missing)} rows are missing in {len(missing)} place{'s' if len(missing) > 1 else ''} at a "
            f"period of {clock.period_s:.6g} s; they are interpolated"
        )
    if rate_hz is not None:
        notes.append(
            f"clock: the channels are interpolated from ticks of {span_text(clock.period_s)} to {rate_hz:.6g} Hz"
        )
    return tuple(notes)


def span_text(span_s: float) -> str:
    """A span of time in us, ms or s, of four digits."""
    factor, unit = (1e6, "us") if span_s < 1e-3 else (1e3, "ms") if span_s < 1.0 else (1.0, "s")
    return f"{factor * span_s:.4g} {unit}"


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
    if time_s.min() == time_s.max():
        problem = f"the stamps are all {time_s[0]:g} s"
        advice = "say the rate of the rows: hil import FILE --rate HZ"
    elif not steps[row - 1]:
        problem = "repeats (a duplicate row, or stamps with too few digits)"
    elif back > max(3, time_s.size // 100):
        problem, advice = f"runs back in {back} places, the rows are out of order", "sort the file by its time"
    else:
        problem = "runs back"
        advice = "two recordings in one file, or rows out of order: cut the file there, or sort it"
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


def _of_gaps(time_s: FloatArray, pieces: list[slice], kept: list[slice], typical: float) -> tuple[str, ...]:
    """Notes on the gaps, and on parts that are too short."""
    if len(pieces) == 1:
        return ()
    gaps = [float(time_s[piece.start] - time_s[piece.start - 1]) for piece in pieces[1:]]
    sizes = (
        f"a gap of {gaps[0]:.4g} s" if len(gaps) == 1 else f"{len(gaps)} gaps of {min(gaps):.4g} to {max(gaps):.4g} s"
    )
    starts = ", ".join(f"{time_s[piece.start] - time_s[0]:.4g}" for piece in kept[:10])
    text = (
        f"clock: {sizes} between steps of {typical:.4g} s, first after row {pieces[1].start} of the numbers: cut into "
        f"{len(kept)} part{'s' if len(kept) > 1 else ''}, from {starts}{', ...' if len(kept) > 10 else ''} s on"
    )
    lost = sum(piece.stop - piece.start for piece in pieces) - sum(piece.stop - piece.start for piece in kept)
    return (text + (f"; {lost} rows in parts of less than {LEAST_ROWS} are left out" if lost else ""),)


def _at_ticks(
    columns: Mapping[str, FloatArray], kept: list[slice], ticks: list[Ticks], period_s: float
) -> list[dict[str, FloatArray]]:
    """The rows of each part at each of its ticks, linear where rows are missing."""
    parts = []
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
