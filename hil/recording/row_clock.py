"""Decide from the motion whether rows were sampled at equal ticks (their number is the clock) or at their stamps.

Over equal ticks a position sampled at time t deviates from the cubic through its neighbours by v x (t - tick). If the
rows were taken at their stamps, the deviations are v x (stamp - tick); if they were taken at the ticks, they do not
depend on the stamps. The regression coefficient of the deviations on v x (stamp - tick) is therefore 1 or 0, whatever
the noise is; noise and coarse counts only widen its standard error.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hil.arrays import FloatArray

Ticks = NDArray[np.int64]

CLOCK_TOLERANCE = 0.01  # of the period: what a step of a regular clock may deviate
_NEAR, _FAR = 3, 5  # rows on each side for two estimates of the velocity, none of them in the cubic
_BLOCK = 20  # rows: deviations are dependent over a few rows, blocks are not
_ERRORS = 3.0  # standard errors between the share and the middle of both clocks
_LONG = 1.3  # periods: after a longer step either a row is late or rows are missing
_REACH = 15  # rows on each side that tell the two apart: a late row does not shift those after it
_DIGIT = 0.01  # of a digit: deviation of a step from whole digits
_JUMPS = 5  # steps of each size from which their spread tells rounding from missing rows
_ENDS = 200  # jumps at both ends of a part, which bound the period most closely
_ROUNDING = 1.05  # digits over which rounded stamps spread about their ticks; the ticks themselves jitter a little
_SPAN = 8  # steps over which the period is taken: rounded and late stamps even out


@dataclass(frozen=True)
class StampShare:
    """Share of the stamps' unevenness that the rows have: 0 for equal ticks, 1 for true stamps; its standard error."""

    share: float
    error: float

    @property
    def says_rows(self) -> bool:
        """The rows are clearly equal ticks."""
        return abs(self.share) + _ERRORS * self.error < 0.5

    @property
    def says_stamps(self) -> bool:
        """The rows were clearly taken at their stamps."""
        return abs(self.share - 1.0) + _ERRORS * self.error < 0.5


@dataclass(frozen=True)
class Rounded:
    """Equal ticks whose stamps are rounded to `digit_s`: their period, and by how much it may be another one [s]."""

    period_s: float
    error_s: float
    digit_s: float


@dataclass(frozen=True, eq=False)
class RowClock:
    """Ticks of the rows of each part from 0, their period [s], and the rms jitter of the stamps about them [s]."""

    ticks: list[Ticks]
    period_s: float
    jitter_s: float
    rounded: Rounded | None = None  # stamps that are those of the ticks but for their digits

    @property
    def missing(self) -> list[int]:
        """Number of missing rows in each place where rows are missing."""
        return [int(step) - 1 for ticks in self.ticks for step in np.diff(ticks) if step > 1]


def row_clock(columns: Mapping[str, FloatArray], kept: list[slice], period_s: float) -> tuple[RowClock | None, bool]:
    """Clock of equal ticks, None if the stamps are the clock, and whether the motion or the stamps tell which.

    `columns` (n,) with `time_s` [s], `kept` the parts without gaps, `period_s` the typical step [s]. Stamps at whole
    periods within 1 % are believed to be ticks unless the motion clearly denies it, others are believed unless the
    motion clearly says that rows are equal ticks, with rows missing where the stamps say so or with none missing.
    """
    stamps = [columns["time_s"][piece] for piece in kept]
    if (rounded := rounded_ticks(stamps)) is not None:
        numbers = [np.arange(times.size) for times in stamps]
        if not stamp_share(columns, kept, numbers).says_stamps:
            return RowClock(numbers, rounded.period_s, _jitter_s(stamps, numbers), rounded), True
    whole = all(at_whole_periods(np.diff(times), period_s) for times in stamps)
    if whole:
        counts = [[np.r_[0, np.cumsum(np.round(np.diff(times) / period_s))].astype(np.int64) for times in stamps]]
    else:
        counts = [[row_ticks(times) for times in stamps]]
        if any(int(ticks[-1]) != ticks.size - 1 for ticks in counts[0]):
            counts.append([np.arange(times.size) for times in stamps])
    shares = [stamp_share(columns, kept, ticks) for ticks in counts]
    for ticks, share in zip(counts, shares, strict=True):
        if (share.says_rows and _follow(stamps, ticks)) or (whole and not share.says_stamps):
            return RowClock(ticks, slope(stamps, ticks), _jitter_s(stamps, ticks)), True
    return None, shares[0].says_stamps


def rounded_ticks(times: list[FloatArray]) -> Rounded | None:
    """Equal ticks without a missing row that explain the stamps of all parts by rounding alone; None if none do.

    The steps then have two sizes, one digit apart, evenly spread. Each pair of rows bounds the period by a digit over
    the rows between them.
    """
    steps = np.concatenate([np.diff(one) for one in times])
    small, large = float(steps.min()), float(steps.max())
    digit = large - small
    if digit <= 0.0 or np.any(np.minimum(steps - small, large - steps) > _DIGIT * digit):
        return None
    whole = small / digit
    jumps = int(np.sum(steps > small + 0.5 * digit))
    least = _JUMPS if whole > 0.5 else 2  # a stamp that repeats is no missing row
    if abs(whole - round(whole)) > _DIGIT * max(whole, 1.0) or min(jumps, steps.size - jumps) < least:
        return None
    low, high = 0.0, np.inf
    for one in times:
        rows = np.flatnonzero(np.diff(one) > small + 0.5 * digit)
        rows = np.r_[rows[:_ENDS], rows[_ENDS:][-_ENDS:]]
        last, first = rows, rows + 1  # of a digit, and of the next one
        for begin, end, more in ((last, first, -digit), (first, last, digit)):
            span = end[None, :] - begin[:, None]
            period = (one[end][None, :] - one[begin][:, None] + more) / np.maximum(span, 1)
            bounds = period[span > 0]
            if bounds.size and more < 0.0:
                low = max(low, float(bounds.max()))
            elif bounds.size:
                high = min(high, float(bounds.min()))
    if not np.isfinite(high):
        return None
    period_s = 0.5 * (low + high)
    off = max(float(np.ptp(one - period_s * np.arange(one.size))) for one in times)
    return Rounded(round(period_s, 12), 0.5 * abs(high - low), digit) if off <= _ROUNDING * digit else None


def _follow(times: list[FloatArray], ticks: list[Ticks]) -> bool:
    """True if stamps stay within half a period of their ticks: all missing rows are counted."""
    period_s = slope(times, ticks)
    for time_s, at in zip(times, ticks, strict=True):
        late = (time_s - time_s[0]) / period_s - at
        near = min(2 * _REACH, late.size)
        smooth = np.median(sliding_window_view(late - np.median(late), near), axis=1)
        if np.max(np.abs(smooth)) > 0.5:
            return False
    return True


def row_ticks(time_s: FloatArray) -> Ticks:
    """Number the rows of a part (n,) in ticks from 0: after a long step ticks are left out if later rows are late, too.

    A row that is stamped late, alone or in a burst, leaves no tick out. Longest steps come first, because a place where
    rows are missing makes rows near it late.
    """
    span = min(_SPAN, time_s.size - 1)
    period_s = float(np.median(time_s[span:] - time_s[:-span])) / span
    late = (time_s - time_s[0]) / period_s - np.arange(time_s.size)
    steps = np.diff(late) + 1.0
    medians = np.median(sliding_window_view(np.pad(late, _REACH, mode="edge"), _REACH), axis=1)
    shift = medians[_REACH:-1] - medians[: -_REACH - 1]
    places = np.flatnonzero(np.r_[False, steps >= _LONG] & (shift > 0.5))
    left_out = np.zeros(time_s.size, dtype=np.int64)
    for least in (0.5, 1.0 - (_LONG - 1.0)):  # first as many as the step itself says, then as it may have with jitter
        for row in places[np.argsort(-steps[places - 1], kind="stable")]:
            most = int(steps[row - 1] - 1.0 + least)
            left_out[row] = min(most, max(0, _shift(late, left_out, int(row))))
    return np.asarray(np.arange(time_s.size) + np.cumsum(left_out), dtype=np.int64)


def _shift(late: FloatArray, left_out: Ticks, row: int) -> int:
    """Ticks by which rows from `row` on are later than those before, beside the ticks left out at other places."""
    first = max(0, row - _REACH)
    others = left_out[first : row + _REACH].copy()
    others[row - first] = 0
    near = late[first : row + _REACH] - np.cumsum(others)
    return round(float(np.median(near[row - first :]) - np.median(near[: row - first])))


def stamp_share(columns: Mapping[str, FloatArray], kept: list[slice], ticks: list[Ticks]) -> StampShare:
    """Share of the stamps' unevenness about `ticks` that the rows have, by the column that tells it best.

    Without motion its standard error is infinite.
    """
    best = StampShare(0.0, np.inf)
    times = [columns["time_s"][piece] for piece in kept]
    period_s = slope(times, ticks)
    for name, values in columns.items():
        if name == "time_s" or np.ptp(values) == 0.0:
            continue
        parts = zip(times, kept, ticks, strict=True)
        found = _share([_terms(time_s, values[piece], at, period_s) for time_s, piece, at in parts])
        best = min(best, found, key=lambda share: share.error)
    return best


def slope(times: list[FloatArray], ticks: list[Ticks]) -> float:
    """Period of counted rows [s]: slope of the stamps of all parts over their ticks, rounded to 1 ps."""
    product, power = 0.0, 0.0
    for time_s, at in zip(times, ticks, strict=True):
        centred = at - at.mean()
        product += float(centred @ (time_s - time_s.mean()))
        power += float(centred @ centred)
    return round(product / power, 12)


def at_whole_periods(steps: FloatArray, period_s: float) -> bool:
    """True if every step (n,) is a whole multiple of the period, at least one."""
    whole = np.maximum(np.round(steps / period_s), 1.0) * period_s
    return bool(np.all(np.abs(steps - whole) <= CLOCK_TOLERANCE * period_s))


def _terms(time_s: FloatArray, values: FloatArray, ticks: Ticks, period_s: float) -> FloatArray:
    """Sums over blocks of rows (2, blocks) of instrument x deviation and instrument x deviation by the stamps.

    Deviations by the stamps and the instrument take the velocity from different rows, so that noise does not bias.
    """
    if time_s.size <= 2 * _FAR:
        return np.zeros((2, 0))
    inner = slice(_FAR - 2, time_s.size - _FAR - 2)
    stamps = (time_s - time_s[0]) / period_s
    deviation, uneven = (_cubic_error(ticks.astype(np.float64), one)[inner] for one in (values, stamps))
    near, far = (_velocity(values, ticks, reach)[_FAR - reach : values.size - _FAR - reach] for reach in (_NEAR, _FAR))
    instrument = far * uneven
    starts = np.arange(0, instrument.size, _BLOCK)
    sums = [np.add.reduceat(instrument * one, starts) for one in (deviation, near * uneven)]
    return np.asarray(sums, dtype=np.float64)


def _share(parts: list[FloatArray]) -> StampShare:
    """Regression coefficient of the deviations, with a standard error by blocks."""
    measured, expected = np.concatenate(parts, axis=1)
    total = float(expected.sum())
    if total <= 0.0:
        return StampShare(0.0, np.inf)
    share = float(measured.sum()) / total
    return StampShare(share, float(np.sqrt(np.sum((measured - share * expected) ** 2))) / total)


def _velocity(values: FloatArray, ticks: Ticks, reach: int) -> FloatArray:
    """Change of values per tick over `reach` rows on each side (n - 2 reach,)."""
    return np.asarray((values[2 * reach :] - values[: -2 * reach]) / (ticks[2 * reach :] - ticks[: -2 * reach]))


def _jitter_s(times: list[FloatArray], ticks: list[Ticks]) -> float:
    errors = [_cubic_error(at.astype(np.float64), time_s - time_s[0]) for time_s, at in zip(times, ticks, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _cubic_error(time: FloatArray, values: FloatArray) -> FloatArray:
    """Value less the cubic (Lagrange) through two neighbours on each side, over the weight of white noise (n - 4,)."""
    n = time.size - 4
    at = time[2 : 2 + n]
    others = [slice(0, n), slice(1, n + 1), slice(3, n + 3), slice(4, n + 4)]
    error, weight = values[2 : 2 + n].copy(), np.ones(n)
    for one in others:
        factor = np.ones(n)
        for other in others:
            if other is not one:
                factor *= (at - time[other]) / (time[one] - time[other])
        error -= factor * values[one]
        weight += factor**2
    return np.asarray(error / np.sqrt(weight))
