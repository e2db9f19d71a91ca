"""Velocity and acceleration of a measured position, by parabolas over 0.021 s; a torque beside them is smoothed alike.

A. Savitzky, M. J. E. Golay, Smoothing and Differentiation of Data by Simplified Least Squares Procedures, Analytical
Chemistry 36, 1964.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from hil.arrays import FloatArray

SMOOTH_S = 0.021  # window of the parabolas: passes some 20 Hz, averages encoder counts
_AT_REST = 0.01  # of the top speed: below lie rest and noise
_SHORTEST = 5  # rows of a parabola that averages noise on both sides


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Smoothed position with its derivatives (n,) in the unit of the position, and the direction of motion -1, 0, 1."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    direction: FloatArray


def motion(position: FloatArray, period_s: float, smooth_s: float = SMOOTH_S) -> MeasuredMotion:
    """Motion of a position (n,) sampled at `period_s`; the direction is 0 at rest, below 1 % of the top speed."""
    smooth, velocity, acceleration = (_filtered(position, period_s, order, smooth_s) for order in (0, 1, 2))
    moves = np.abs(velocity) > _AT_REST * np.max(np.abs(velocity), initial=0.0)
    return MeasuredMotion(smooth, velocity, acceleration, np.where(moves, np.sign(velocity), 0.0))


def smoothed(values: FloatArray, period_s: float) -> FloatArray:
    """Values (n,) through the filter of `motion`."""
    return _filtered(values, period_s, 0, SMOOTH_S)


def window_rows(period_s: float, smooth_s: float = SMOOTH_S) -> int:
    """Rows of a parabola, odd."""
    return max(round(smooth_s / period_s) | 1, _SHORTEST)


def rows_per_sample(period_s: float) -> float:
    """Rows of a smoothed signal for one independent sample: the inverse noise gain of a parabola of w rows.

    White noise of variance s^2 keeps s^2 (9 w^2 - 21) / (4 w (w^2 - 4)), about 9 / (4 w).
    """
    w = window_rows(period_s)
    return 4.0 * w * (w**2 - 4.0) / (9.0 * w**2 - 21.0)


def _filtered(values: FloatArray, period_s: float, order: int, smooth_s: float) -> FloatArray:
    """Derivative (n,) of an order; of fewer rows than the window by a parabola over those there are."""
    window = min(window_rows(period_s, smooth_s), (values.size - 1) | 1)
    if window < 3:
        return np.zeros(values.size) if order else values
    return np.asarray(savgol_filter(values, window, 2, deriv=order, delta=period_s), dtype=np.float64)
