"""Change points of a quantity over months: steps and slopes, by a likelihood with a bounded rate of false ones.

    min over partitions and noises   n log(chi^2 / n) + segments log det + order log n + threshold (changes + slopes)

Each segment has a level of its own, and a slope if that pays one more threshold. The noise is correlated from one
recording to the next, with one variance and the same correlations in all segments (`segment_costs`). These are not
known: whether a wander is noise or changes is decided by the same sum, once with the noise that fits best without any
change, once with that which fits best with them (Shi, Gallagher, Lund, Killick 2022). The order of the noise is 1, or
2 if that pays log n (Schwarz 1978), as for a wander below the scatter of single recordings. For a given noise the best
partition is exact (Jackson et al. 2005), for a given partition the noise is fitted; both in turn, from several noises.

A segment has 4 recordings at least, so a recording that has not 3 others near it among its 6 next cannot be part of
one: it is set aside, as a bounded loss does (Fearnhead, Rigaill 2019). An outlier is no change, nor are three.

The threshold holds for a stated rate of false changes: see `threshold_of`.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.fleet.segment_costs import SegmentCosts, partial_correlations

LOOKS = 365.0  # recordings in which one false change of an axis is expected at most
FEWEST = 12  # recordings, below which their noise is not known
SHORTEST = 4  # recordings of a segment
PLACE = 7.35  # chi^2 within which a place is in the 95 % interval: -2 log(1 - sqrt 0.95), Siegmund 1988
_STEP = math.sqrt(9.0 + PLACE)  # standard errors of a step beyond those that the best place of a slope shows
_CALIBRATED = 9.0  # by simulation, see `threshold_of`
_ORDERS = (1, 2)  # of the noise
_STARTS = (0.0, 0.5, 0.8)  # correlations to begin with
_TURNS = 3  # of partition and noise
_NEAR = 3.0  # standard deviations of the noise over two recordings, within which a neighbour is near
_BESIDE = 3  # recordings to each side that are neighbours
_MAD = 1.4826  # standard deviation over median absolute deviation of normal values
_WINSORIZED, _KEPT = 2.0, 0.9205  # standard deviations, and the variance of normal values that are clipped there
_BLOCK = 64  # ends of stretches whose costs are computed at once
_LEAST = 1e-9  # of the largest value: scatter of what is always alike


@dataclass(frozen=True)
class Stretch:
    """A stretch of recordings `first` to `last` (exclusive): level at its begin and end, slope a day, their errors."""

    first: int
    last: int
    begin: float
    end: float
    level_error: float
    slope: float = 0.0
    slope_error: float = 0.0


@dataclass(frozen=True)
class ChangePoint:
    """A change between two recordings: day, its 95 % interval, step and change of the slope with errors."""

    day: float
    earliest: float
    latest: float
    step: float
    step_error: float
    slope: float
    slope_error: float
    before: float  # level before it

    @property
    def kind(self) -> str:
        """`step` where the level differs by more than errors and the choice of the place make, else `slope`."""
        return "step" if abs(self.step) > _STEP * self.step_error else "slope"


@dataclass(frozen=True)
class History:
    """Segments of a quantity, the changes between them, and the scatter of a recording about them."""

    stretches: tuple[Stretch, ...]
    changes: tuple[ChangePoint, ...]
    scatter: float

    @property
    def now(self) -> Stretch:
        """The last stretch."""
        return self.stretches[-1]


class _Segment(NamedTuple):
    first: int
    last: int
    sloping: bool


class _Fit(NamedTuple):
    """A partition with the noise it was fitted with: variance of the innovations, and the criterion."""

    costs: SegmentCosts
    segments: list[_Segment]
    variance: float
    criterion: float


def history(day: FloatArray, values: FloatArray, errors: FloatArray, quantities: int = 1) -> History | None:
    """Partition values (n,) with standard errors (n,) at days (n,), which increase; None for too few.

    `quantities` are watched at once: together they have the stated rate of false changes.
    """
    if values.size < FEWEST:
        return None
    spread = max(0.5 * _spread(values[2:] - values[:-2]), float(np.median(errors**2)))
    near = _near(values, _NEAR * math.sqrt(spread))
    rows = np.flatnonzero(near) if np.count_nonzero(near) >= FEWEST else np.arange(values.size)
    day, values, scales = day[rows], values[rows], _scales(values, errors)[rows]
    least = max(_LEAST * float(np.max(np.abs(values))), 1e-30) ** 2
    fits = list(_fits(day, values, scales, threshold_of(quantities), least / float(np.median(scales)) ** 2))
    best = min(fits, key=lambda one: one.criterion)
    return _told(best, day, rows, float(np.median(scales)))


def threshold_of(quantities: int) -> float:
    """Gain of twice the log-likelihood that a step or a slope needs, if so many quantities are watched.

    By chance a gain is above it as seldom as exp(-threshold / 2), for 12 recordings as for 365. The constant is such
    that an axis has one false change a year at most for each kind of noise that `tests/net/fleet_bars.py alarms` draws:
    white, heavy tails, correlated up to 0.8, half of it white; white and 0.8 also with outliers of 8 standard
    deviations in 3 % of the recordings. Drawn were 40 to 100 years with a look every 10 or 12 recordings. A look a day
    sees more: of one quantity 0 in 100 years of white noise, 0 in 70 correlated by 0.5, 3 in 30 by 0.8.
    """
    return 2.0 * math.log(LOOKS * quantities) + _CALIBRATED


def _fits(day: FloatArray, values: FloatArray, scales: FloatArray, threshold: float, least: float) -> Iterator[_Fit]:
    """Partitions with the noise that fits each: without a change, then from several noises on."""
    count = values.size

    def fitted(segments: list[_Segment], costs: SegmentCosts, order: int) -> _Fit:
        """Fit the noise of this order to the residuals of a partition; `costs` gave these residuals."""
        left = [costs.left(*one) for one in segments]
        costs = SegmentCosts(day, values, scales, partial_correlations(left, order))
        chi2 = sum(float(costs.of(one.first, one.last)[one.sloping]) for one in segments) + count * least
        terms = len(segments) - 1 + sum(one.sloping for one in segments)
        criterion = count * math.log(chi2 / count) + len(segments) * costs.added
        criterion += order * math.log(count) + threshold * terms
        return _Fit(costs, segments, chi2 / (count - 1 - terms), criterion)

    whole = [_Segment(0, count, False)]
    for order in _ORDERS:
        one = fitted(whole, SegmentCosts(day, values, scales, ()), order)
        for _ in range(_TURNS):
            one = fitted(whole, one.costs, order)
        yield one
    for start in _STARTS:
        costs, segments = SegmentCosts(day, values, scales, (start,)), whole
        innovations = (values[2:] - (1.0 + start) * values[1:-1] + start * values[:-2]) / scales[1:-1]  # differences
        variance = max(0.5 * _spread(innovations), least)
        for _ in range(_TURNS):
            found = _partition(costs, count, threshold, variance)
            if found in (whole, segments):
                break
            both = [fitted(found, costs, order) for order in _ORDERS]
            yield from both
            costs, segments, variance, _ = min(both, key=lambda one: one.criterion)


def _partition(costs: SegmentCosts, count: int, threshold: float, variance: float) -> list[_Segment]:
    """The best partition for innovations of a known variance."""
    price = variance * threshold
    best, begins = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=int)
    slopes, best[0] = np.zeros(count + 1, dtype=bool), 0.0
    for block in range(SHORTEST, count + 1, _BLOCK):
        ends = np.arange(block, min(block + _BLOCK, count + 1))
        with np.errstate(all="ignore"):  # stretches that end before they begin are not read
            level, line = costs.of(np.arange(ends[-1])[None, :], ends[:, None])
        sloping = line + price < level
        cost = np.where(sloping, line + price, level) + price + variance * costs.added
        for end, of_end, slope in zip(ends, cost, sloping, strict=True):
            total = best[: end - SHORTEST + 1] + of_end[: end - SHORTEST + 1]
            at = int(np.argmin(total))
            best[end], begins[end], slopes[end] = total[at], at, slope[at]
    found, last = list[_Segment](), count
    while last > 0:
        found.append(_Segment(int(begins[last]), last, bool(slopes[last])))
        last = found[-1].first
    return found[::-1]


def _told(fit: _Fit, day: FloatArray, rows: NDArray[np.intp], scale: float) -> History:
    """Stretches and changes of a fit to the recordings `rows`."""
    sigma = math.sqrt(fit.variance)
    stretches = list[Stretch]()
    for first, last, sloping in fit.segments:
        line, begin, end = fit.costs.line(first, last, sloping), day[first], day[last - 1]
        error = sigma * max(line.error_at(begin), line.error_at(end))
        ends = int(rows[first]), int(rows[last - 1]) + 1
        stretches.append(Stretch(*ends, line.at(begin), line.at(end), error, line.slope, sigma * line.slope_error))
    changes = [_change(fit, day, at, before, after) for at, (before, after) in enumerate(pairwise(stretches))]
    share = math.prod(1.0 - one**2 for one in fit.costs.partial)
    return History(tuple(stretches), tuple(changes), scale * sigma / math.sqrt(share))


def _change(fit: _Fit, day: FloatArray, at: int, before: Stretch, after: Stretch) -> ChangePoint:
    """The change after segment `at`; its interval holds the places that fit nearly as well."""
    one, other = fit.segments[at : at + 2]
    places = np.arange(one.first + SHORTEST, other.last - SHORTEST + 1)
    cost = fit.costs.of(one.first, places)[one.sloping] + fit.costs.of(places, other.last)[other.sloping]
    inside = places[cost <= cost.min() + PLACE * fit.variance]
    end, begin = day[one.last - 1], day[other.first]
    middle = float(0.5 * (end + begin))
    return ChangePoint(
        middle,
        float(day[inside[0] - 1]),
        float(day[inside[-1]]),
        float(after.begin + after.slope * (middle - begin) - before.end - before.slope * (middle - end)),
        math.hypot(before.level_error, after.level_error),
        after.slope - before.slope,
        math.hypot(before.slope_error, after.slope_error),
        before.end,
    )


def _near(values: FloatArray, within: float) -> NDArray[np.bool_]:
    """Recordings (n,) with as many of their next ones near them as a segment needs."""
    count, wide = values.size, 2 * _BESIDE + 1
    first = np.clip(np.arange(count) - _BESIDE, 0, count - wide)
    beside = values[first[:, None] + np.arange(wide)]
    near = np.count_nonzero(np.abs(beside - values[:, None]) <= within, axis=1) - 1  # itself
    return np.asarray(near >= SHORTEST - 1)


def _scales(values: FloatArray, errors: FloatArray) -> FloatArray:
    """Scale (n,) of the noise of each recording: its standard error, and beyond it the scatter of all.

    Part of a standard error may be alike in all recordings and scatter less: then they only weigh.
    """
    own = float(np.median(errors**2))
    beyond = max(0.5 * _spread(values[2:] - values[:-2]) - own, 0.0)
    scales = np.sqrt(np.maximum(errors, 1e-3 * float(np.max(errors))) ** 2 + beyond)
    return scales if np.all(scales > 0.0) else np.ones_like(values)


def _spread(differences: FloatArray) -> float:
    """Variance of differences about their median, without outliers."""
    left = differences - np.median(differences)
    scale = _MAD * float(np.median(np.abs(left)))
    for _ in range(5):
        bound = _WINSORIZED * scale
        scale = math.sqrt(float(np.mean(np.clip(left, -bound, bound) ** 2)) / _KEPT)
    return scale**2
