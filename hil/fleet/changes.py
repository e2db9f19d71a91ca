"""Change points of a quantity over months: steps and slopes, by optimal partitioning with a bounded rate of false ones.

    min over partitions   sum of segments  [ chi^2 of a level, or of a level and a slope + threshold ]  + thresholds

Each segment has a level of its own, and a slope if that pays one more threshold (Jackson et al. 2005). chi^2 has the
variance s_i^2 + b^2 of a recording, s_i its standard error and b the scatter between recordings, times what scatter
that is correlated from one recording to the next adds in a mean, (1 + r) / (1 - r). All is estimated from differences
of recordings one and two apart, which steps and slopes hardly change. Where recordings scatter less than the s_i say,
these hold what is alike in all of them, and only weigh.

The threshold. A recording a day is a look a day at n places, each for a step and a slope, of Q quantities. With

    p = 1 / (365 * 2 n Q)       of each look, place and quantity

the sum over all of them is one false change a year at most (Bonferroni): the threshold is the square of the quantile of
Student's t at p, with 0.6 degrees of freedom for each recording: the variance of n differences has 2/3 n (von Neumann).
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import stdtrit

from hil.arrays import FloatArray

LOOKS = 365.0  # recordings in which one false change of an axis is expected at most
FEWEST = 12  # recordings, below which the scatter between them is not known
SHORTEST = 4  # recordings of a segment: fewer may be outliers
PLACE = 7.35  # chi^2 within which a place is in the 95 % interval: -2 log(1 - sqrt 0.95), Siegmund 1988
_CLIPPED = 3.0  # standard deviations from the median of its neighbours, beyond which a value counts as so far
_NEIGHBOURS = 7
_MAD = 1.4826  # standard deviation over median absolute deviation of normal values
_WINSORIZED, _KEPT = 2.0, 0.9205  # standard deviations, and the variance of normal values that are clipped there
_MOST_CORRELATED = 0.7  # from one recording to the next: more is a wander, which is a change
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
        """`step` where the level differs by three standard errors, else `slope`."""
        return "step" if abs(self.step) > 3.0 * self.step_error else "slope"


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


def history(day: FloatArray, values: FloatArray, errors: FloatArray, quantities: int = 1) -> History | None:
    """Partition values (n,) with standard errors (n,) at days (n,), which increase; None for too few.

    `quantities` are watched at once: together they have the stated rate of false changes.
    """
    n = values.size
    if n < FEWEST:
        return None
    total, correlated = _scatter(values, errors)
    near = median_filter(values, _NEIGHBOURS, mode="nearest")
    clipped = np.clip(values, near - _CLIPPED * np.sqrt(total), near + _CLIPPED * np.sqrt(total))
    costs = _Costs(day, clipped, 1.0 / (total * correlated))
    threshold = threshold_of(n, quantities)
    begins, kinds = _partition(costs, n, threshold)
    edges = [*begins, n]
    stretches = tuple(
        costs.stretch(first, last, sloping) for (first, last), sloping in zip(pairwise(edges), kinds, strict=True)
    )
    changes = tuple(_change(costs, day, before, after) for before, after in pairwise(stretches))
    return History(stretches, changes, float(np.sqrt(np.median(total))))


def threshold_of(count: int, quantities: int) -> float:
    """chi^2 that a step or a slope must remove, of so many recordings and quantities."""
    p = 1.0 / (LOOKS * 2.0 * count * quantities)
    return float(stdtrit(0.6 * count, 1.0 - 0.5 * p) ** 2)


class _Costs:
    """chi^2 of a level or a line over any stretch, from sums of the weighted values."""

    def __init__(self, day: FloatArray, values: FloatArray, weights: FloatArray) -> None:
        self.day = day
        self._middle = (float(day.mean()), float(values.mean()))
        t, y = day - self._middle[0], values - self._middle[1]
        sums = np.array([weights, weights * t, weights * t * t, weights * y, weights * t * y, weights * y * y])
        self._sums = np.concatenate([np.zeros((6, 1)), np.cumsum(sums, axis=1)], axis=1)

    def of(self, first: int | NDArray[np.intp], last: int | NDArray[np.intp], sloping: bool) -> FloatArray:
        """chi^2 of stretches `first` to `last`."""
        begin, end = np.broadcast_arrays(first, last)
        w, t, tt, y, ty, yy = self._sums[:, end] - self._sums[:, begin]
        level = yy - y * y / w
        if not sloping:
            return np.asarray(np.maximum(level, 0.0))
        spread = np.maximum(tt - t * t / w, 1e-300)
        return np.asarray(np.maximum(level - (ty - t * y / w) ** 2 / spread, 0.0))

    def stretch(self, first: int, last: int, sloping: bool) -> Stretch:
        """Fit a stretch."""
        w, t, tt, y, ty, _ = self._sums[:, last] - self._sums[:, first]
        middle, level = t / w, y / w + self._middle[1]
        spread = max(tt - t * t / w, 1e-300)
        slope = float((ty - t * y / w) / spread) if sloping else 0.0
        begin, end = (self.day[at] - self._middle[0] - middle for at in (first, last - 1))
        slope_error = 1.0 / math.sqrt(spread) if sloping else 0.0
        error = math.hypot(1.0 / math.sqrt(w), slope_error * max(abs(begin), abs(end)))
        return Stretch(first, last, float(level + slope * begin), float(level + slope * end), error, slope, slope_error)


def _partition(costs: _Costs, count: int, threshold: float) -> tuple[list[int], list[bool]]:
    """First rows of the stretches of the best partition, and whether each slopes."""
    best, begins = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=int)
    slopes, best[0] = np.zeros(count + 1, dtype=bool), 0.0
    for end in range(SHORTEST, count + 1):
        first = np.arange(end - SHORTEST + 1)
        level, line = costs.of(first, end, False), costs.of(first, end, True) + threshold
        cost = best[first] + np.minimum(level, line) + threshold
        at = int(np.argmin(cost))
        best[end], begins[end], slopes[end] = cost[at], at, line[at] < level[at]
    found, kinds, end = list[int](), list[bool](), count
    while end > 0:
        found.append(int(begins[end]))
        kinds.append(bool(slopes[end]))
        end = int(begins[end])
    return found[::-1], kinds[::-1]


def _change(costs: _Costs, day: FloatArray, before: Stretch, after: Stretch) -> ChangePoint:
    """The change between two stretches; its interval holds the places that fit nearly as well."""
    places = np.arange(before.first + SHORTEST, after.last - SHORTEST + 1)
    fits = [
        costs.of(before.first, places, before.slope_error > 0.0),
        costs.of(places, after.last, after.slope_error > 0.0),
    ]
    cost = np.sum(fits, axis=0)
    inside = places[cost <= cost.min() + PLACE]
    at = before.last
    middle = 0.5 * (day[at - 1] + day[at])
    return ChangePoint(
        float(middle),
        float(day[inside[0] - 1]),
        float(day[inside[-1]]),
        after.begin + after.slope * (middle - day[at]) - before.end - before.slope * (middle - day[at - 1]),
        math.hypot(before.level_error, after.level_error),
        after.slope - before.slope,
        math.hypot(before.slope_error, after.slope_error),
        before.end,
    )


def _scatter(values: FloatArray, errors: FloatArray) -> tuple[FloatArray, float]:
    """Variance (n,) of each recording, and the factor that the correlation of neighbours makes.

    Part of a standard error may be alike in all recordings and scatter less: then they only weigh.
    """
    weight = np.maximum(errors, 1e-3 * float(np.max(errors, initial=0.0))) / (float(np.median(errors)) or 1.0)
    weight = weight if np.all(weight > 0.0) else np.ones_like(values)  # noisier recordings count as such
    near, far = (_spread((values[lag:] - values[:-lag]) / np.hypot(weight[lag:], weight[:-lag])) for lag in (1, 2))
    own = float(np.median(errors**2))
    by_chance = 0.5 / math.sqrt(values.size)
    correlation = float(np.clip(far / near - 1.0 - by_chance, 0.0, _MOST_CORRELATED)) if near > 0.0 else 0.0
    variance = max(near / (1.0 - correlation), 1e-300)
    beyond = max(variance - own, 0.0)
    total = (errors**2 + beyond) * variance / (own + beyond)
    least = max(_LEAST * float(np.max(np.abs(values))), 1e-30) ** 2
    return np.maximum(total, least), (1.0 + correlation) / (1.0 - correlation)


def _spread(differences: FloatArray) -> float:
    """Variance of differences about their median, without outliers."""
    left = differences - np.median(differences)
    scale = _MAD * float(np.median(np.abs(left)))
    for _ in range(5):
        bound = _WINSORIZED * scale
        scale = math.sqrt(float(np.mean(np.clip(left, -bound, bound) ** 2)) / _KEPT)
    return scale**2
