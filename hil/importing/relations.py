"""Relations between columns: which is the derivative, a multiple or the cause of another.

velocity    v = k dp/dt            k tells the units
position    p = k q + c            another encoder, or the set-point
effort      u = J a + D v + F sign(v) + c + w q          the plain model over the motion of q
"""

from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.identification.derivatives import MeasuredMotion, smoothed
from hil.identification.least_squares import LinearFit, least_squares
from hil.identification.plain_model import plain_columns

SMOOTH = 0.3  # roughness of a motion; rows without order have 1.4
SAME_POSITION = 0.98  # share from which a column is another reading of a position: following errors are below 5 %
IS_DERIVATIVE = 0.9  # share from which a column is the velocity of another: counting and filters leave a few per cent
NO_SPREAD = 0.01  # of the travel: a part of a recording with less motion tells nothing


@dataclass(frozen=True)
class Relation:
    """Factor between two columns, and the share of variance that it explains (0 to 1)."""

    factor: float
    share: float


def proportional(values: FloatArray, other: FloatArray, *, through_zero: bool = False) -> Relation:
    """Fit values = k other + c, both (n,); `through_zero`: without c, and with no share where k is negative."""
    x, y = (other, values) if through_zero else (other - other.mean(), values - values.mean())
    power, total = float(x @ x), float(y @ y)
    if power == 0.0 or total == 0.0:
        return Relation(0.0, 0.0)
    factor = float(x @ y) / power
    against = through_zero and factor < 0.0
    return Relation(factor, 0.0 if against else float(x @ y) ** 2 / (power * total))


def derivative_of(values: FloatArray, moved: MeasuredMotion, period_s: float, through_zero: bool = False) -> Relation:
    """Fit a column (n,) as a multiple of the velocity of a motion; `through_zero`: at a constant speed."""
    return proportional(smoothed(values, period_s), moved.velocity, through_zero=through_zero)


def explained(values: FloatArray, *columns: FloatArray) -> float:
    """Share of the variance of values (n,) that columns (n,) and a constant explain by least squares."""
    named = {str(index): column for index, column in enumerate([*columns, np.ones_like(values)])}
    return least_squares(named, values, blocks=0).share


def lateness_s(values: FloatArray, moved: MeasuredMotion) -> float:
    """Time by which a position (n,) comes after a motion, from least squares: x = k (q - late v) + c."""
    columns = {"k": moved.position, "late": moved.velocity, "c": np.ones_like(moved.position)}
    k, velocity, _ = least_squares(columns, values, blocks=0).values
    return -float(velocity / k) if k else 0.0


def driven(values: FloatArray, moved: MeasuredMotion, period_s: float) -> LinearFit:
    """Fit an effort (n,) by the plain model of a motion, with a load over the position; rows at rest count too."""
    return least_squares(plain_columns(moved, spring=True), smoothed(values, period_s), blocks=0)


def roughness(values: FloatArray) -> float:
    """Median change from row to row over the median deviation: 1.4 for rows without order, far less for a motion."""
    spread = float(np.median(np.abs(values - np.median(values))))
    return float(np.median(np.abs(np.diff(values)))) / spread if spread > 0.0 else 0.0


def noise(values: FloatArray) -> float:
    """White noise of a column in motion over its spread, from fourth differences (variance 70 sigma^2).

    Without the largest tenth, the jerks at the ends of moves, and without rest, where a coarse encoder has no noise.
    """
    spread, far = float(np.std(values)), np.abs(values[4:] - values[:-4])
    moving = far > NO_SPREAD * np.max(far, initial=0.0)
    if spread == 0.0 or not moving.any():
        return 0.0
    size = np.sort(np.abs(np.diff(values, 4))[moving])
    return float(np.sqrt(np.mean(size[: max(round(0.9 * size.size), 1)] ** 2) / 70.0)) / spread


def lead_rows(values: FloatArray, other: FloatArray, most: int) -> int:
    """Rows by which `values` comes before `other`, both (n,), by the correlation of their differences."""
    a, b = np.diff(values), np.diff(other)
    a, b = (a - a.mean())[:20_000], (b - b.mean())[:20_000]

    def agreement(shift: int) -> float:
        first, second = (a[: a.size - shift], b[shift:]) if shift >= 0 else (a[-shift:], b[: b.size + shift])
        return float(first @ second) / float(first.size)

    return max(range(-most, most + 1), key=agreement)
