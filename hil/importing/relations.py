"""Relations between columns: which is the derivative, a multiple or the cause of another.

velocity    v = k dp/dt            k tells the units
position    p = k q + c            another encoder, or the set-point
effort      u = J a + D v + F sign(v) + w q + c          least squares over the motion of q
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from hil.arrays import FloatArray

SMOOTH_S = 0.021  # window of the derivatives: passes some 20 Hz, averages encoder counts
SHORTEST_WINDOW = 5  # rows of a parabola with redundancy
NO_SPREAD = 0.01  # of the travel: a part of a recording with less motion tells nothing


@dataclass(frozen=True, eq=False)
class MotionColumns:
    """Smoothed position and its derivatives (n,) in units of the column."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class Relation:
    """Factor between two columns, and the share of variance that it explains (0 to 1)."""

    factor: float
    share: float


def smoothed(values: FloatArray, period_s: float) -> FloatArray:
    """Values (n,) through the filter of `motion`."""
    return np.asarray(savgol_filter(values, _window(values, period_s), 2), dtype=np.float64)


def motion(position: FloatArray, period_s: float) -> MotionColumns:
    """Position with derivatives from parabolas over `SMOOTH_S`."""
    window = _window(position, period_s)
    parts = (savgol_filter(position, window, 2, deriv=order, delta=period_s) for order in (0, 1, 2))
    return MotionColumns(*(np.asarray(part, dtype=np.float64) for part in parts))


def proportional(values: FloatArray, other: FloatArray) -> Relation:
    """Fit values = k other + c, both (n,)."""
    x, y = other - other.mean(), values - values.mean()
    power, total = float(x @ x), float(y @ y)
    if power == 0.0 or total == 0.0:
        return Relation(0.0, 0.0)
    factor = float(x @ y) / power
    return Relation(factor, float(x @ y) ** 2 / (power * total))


def derivative_of(values: FloatArray, moved: MotionColumns, period_s: float) -> Relation:
    """Fit a column (n,) as a multiple of the velocity of a motion."""
    return proportional(smoothed(values, period_s), moved.velocity)


def explained(values: FloatArray, *columns: FloatArray) -> float:
    """Share of the variance of values (n,) that columns (n,) and a constant explain by least squares."""
    centred = values - values.mean()
    matrix = np.column_stack([column - column.mean() for column in columns])
    left = centred - matrix @ np.linalg.lstsq(matrix, centred, rcond=None)[0]
    return 1.0 - float(left @ left) / max(float(centred @ centred), 1e-300)


def lateness_s(values: FloatArray, moved: MotionColumns) -> float:
    """Time by which a position (n,) comes after a motion, from least squares: x = k (q - late v) + c."""
    columns = np.column_stack([moved.position, moved.velocity, np.ones_like(moved.position)])
    k, velocity, _ = np.linalg.lstsq(columns, values, rcond=None)[0]
    return -float(velocity / k) if k else 0.0


@dataclass(frozen=True, eq=False)
class EffortCause:
    """Share of an effort that a motion explains, and the coefficients J, D, F, w, c (5,)."""

    share: float
    coefficients: FloatArray


def driven(values: FloatArray, moved: MotionColumns, period_s: float) -> EffortCause:
    """Fit an effort (n,) by inertia, friction and load of a motion."""
    effort = smoothed(values, period_s)
    columns = (moved.acceleration, moved.velocity, direction(moved.velocity), moved.position, np.ones_like(effort))
    scales = np.array([float(np.std(column)) or 1.0 for column in columns])
    matrix = np.column_stack(columns) / scales
    solution = np.linalg.lstsq(matrix, effort, rcond=None)[0]
    left = effort - matrix @ solution
    total = float(np.var(effort))
    return EffortCause(1.0 - float(np.var(left)) / total if total > 0.0 else 0.0, np.asarray(solution / scales))


def direction(velocity: FloatArray) -> FloatArray:
    """Sign of the velocity (n,), 0 where it is below a hundredth of its maximum: rest and noise."""
    return np.where(np.abs(velocity) > 0.01 * np.max(np.abs(velocity), initial=0.0), np.sign(velocity), 0.0)


def roughness(values: FloatArray) -> float:
    """Change from row to row over the deviation, of the middle row: 1.4 for rows without order, far less for a "
    "motion."""
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


def _window(values: FloatArray, period_s: float) -> int:
    return min(max(round(SMOOTH_S / period_s) | 1, SHORTEST_WINDOW), (values.size - 1) | 1)
