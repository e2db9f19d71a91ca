"""chi^2 of levels and lines over stretches of a series whose noise is correlated from one recording to the next.

The noise of a stretch is autoregressive of order p, by its partial correlations k_1 ... k_p. Its rows are made
independent: row j of a stretch less what the j rows before predict (Levinson 1947, Durbin 1960), p rows at most. A line
is then an ordinary regression, and its sums over any stretch are differences of running sums.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

_MOST = 0.8  # correlation: more is a wander, which is a change
Rows = int | slice | NDArray[np.intp]
_PAIRS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))  # products of the columns one, day and value


class SegmentCosts:
    """Costs of a level or a line over any stretch of values (n,) with scales (n,) of their noise at days (n,).

    All are for noise whose innovations have the variance 1 in units of the scales. `added` is what the determinant of
    the noise adds for each stretch.
    """

    def __init__(self, day: FloatArray, values: FloatArray, scales: FloatArray, partial: Sequence[float]) -> None:
        self._middle = (float(day.mean()), float(values.mean()))
        self._day = day - self._middle[0]
        self._rows = np.array([np.ones_like(day), self._day, values - self._middle[1]]) / scales
        self.partial = tuple(partial)
        order = len(partial)
        products = self._products(order)
        self._sums = np.concatenate([np.zeros((6, 1)), np.cumsum(products, axis=1)], axis=1)
        self._first = np.zeros_like(products)  # what the first rows of a stretch that begins here add
        for row in range(order):
            self._first[:, : day.size - row] += self._products(row)[:, row:]
        self._first[:, : day.size - order] -= self._sums[:, order : day.size]
        self.added = -sum(at * math.log(1.0 - one**2) for at, one in enumerate(partial, 1))

    def _products(self, known: int) -> FloatArray:
        """Products (6, n) of rows of which `known` ones before are in their stretch."""
        weights = np.zeros(0)
        for one in self.partial[:known]:
            weights = np.append(weights - one * weights[::-1], one)
        rows = self._rows.copy()
        for lag, weight in enumerate(weights, 1):
            rows[:, lag:] -= weight * self._rows[:, :-lag]
        share = math.prod(1.0 - one**2 for one in self.partial[known:])  # of the innovations in the variance of a row
        return np.array([share * rows[one] * rows[other] for one, other in _PAIRS])

    def of(self, first: Rows, last: Rows) -> tuple[FloatArray, FloatArray]:
        """chi^2 of a level, and of a line, over stretches `first` to `last` (exclusive); one of them may be many."""
        one, day, days, value, both, values = self._of(first, last)
        level = np.maximum(values - value * value / one, 0.0)
        spread = np.maximum(days - day * day / one, 1e-300)
        return level, np.maximum(level - (both - day * value / one) ** 2 / spread, 0.0)

    def _of(self, first: Rows, last: Rows) -> FloatArray:
        return np.asarray((self._first[:, first].T + self._sums[:, last].T).T)

    def line(self, first: int, last: int, sloping: bool) -> "FittedLine":
        """Fit a level, or a line, to a stretch."""
        one, day, days, value, both, _ = map(float, self._of(first, last))
        spread = max(days - day * day / one, 1e-300)
        slope = (both - day * value / one) / spread if sloping else 0.0
        slope_error = 1.0 / math.sqrt(spread) if sloping else 0.0
        return FittedLine(
            day / one + self._middle[0], value / one + self._middle[1], slope, 1.0 / math.sqrt(one), slope_error
        )

    def left(self, first: int, last: int, sloping: bool) -> FloatArray:
        """Residuals (m,) of a stretch about its level or its line, in units of the scales."""
        fit = self.line(first, last, sloping)
        one, day, value = self._rows[:, first:last]
        level = fit.level - self._middle[1] - fit.slope * (fit.day - self._middle[0])
        return np.asarray(value - level * one - fit.slope * day)


class FittedLine(NamedTuple):
    """Level at a day, slope a day, and their errors, which are independent."""

    day: float
    level: float
    slope: float
    level_error: float
    slope_error: float

    def at(self, day: float) -> float:
        """Level at a day."""
        return self.level + self.slope * (day - self.day)

    def error_at(self, day: float) -> float:
        """Standard error of the level at a day."""
        return math.hypot(self.level_error, self.slope_error * (day - self.day))


def partial_correlations(left: Sequence[FloatArray], order: int) -> tuple[float, ...]:
    """Partial correlations of the residuals of all stretches together (Burg 1975); negative ones are set to 0."""
    ahead, behind, found = list(left), list(left), list[float]()
    for _ in range(order):
        ahead, behind = [one[1:] for one in ahead], [one[:-1] for one in behind]
        both = sum(float(one @ other) for one, other in zip(ahead, behind, strict=True))
        power = 0.5 * sum(float(one @ one) for one in (*ahead, *behind))
        found.append(min(max(both / max(power, 1e-300), 0.0), _MOST))
        ahead, behind = (
            [one - found[-1] * other for one, other in zip(this, that, strict=True)]
            for this, that in ((ahead, behind), (behind, ahead))
        )
    return tuple(found)
