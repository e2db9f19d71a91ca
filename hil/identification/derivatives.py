"""Velocity and acceleration of a measured position, by parabolas over 0.021 s; a torque beside them is smoothed alike.

A. Savitzky, M. J. E. Golay, Smoothing and Differentiation of Data by Simplified Least Squares Procedures, Analytical
Chemistry 36, 1964.

For an equation of torque and motion at any rate (`matched`): the curvature of the parabola over w rows is the second
difference through a kernel K of w - 2 rows. A second difference is the mean of the true acceleration under a hat of two
rows, whose variance, a sixth of a row squared, (1, 10, 1) / 12 has too (Numerov). So all terms pass the same mean

    a = K * second difference      v = K * central difference      T, q = K * (1, 10, 1) / 12 * samples

and T = J a + D v + k q holds for them as for the samples, however long the window is beside the motion.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import convolve1d

from hil.arrays import FloatArray
from hil.identification.parabola import parabola_filter, parabola_weights

SMOOTH_S = 0.021  # window of the parabolas: passes some 20 Hz, averages encoder counts
_AT_REST = 0.01  # of the top speed: below lie rest and noise
_SHORTEST = 5  # rows of a parabola that averages noise on both sides
_HAT = np.array([1.0, 10.0, 1.0]) / 12.0


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


def matched_motion(position: FloatArray, period_s: float, rows: int) -> MeasuredMotion:
    """Motion of a position (n,), each derivative the same mean of the true one over an odd number of `rows`.

    The direction is the sign of the velocity, at rest too. Within `rows` of both ends values are not exact.
    """
    if position.size < 3:
        nothing = np.zeros(position.size)
        return MeasuredMotion(position, nothing, nothing, nothing)
    kernel, bend = _kernel(rows), np.diff(position, 2) / period_s**2
    velocity = convolve1d(np.gradient(position, period_s), kernel, mode="nearest")
    acceleration = convolve1d(np.concatenate([bend[:1], bend, bend[-1:]]), kernel, mode="nearest")
    return MeasuredMotion(matched(position, rows), velocity, acceleration, np.sign(velocity))


def matched(values: FloatArray, rows: int) -> FloatArray:
    """Values (n,) through the mean of `matched_motion`."""
    return np.asarray(convolve1d(values, np.convolve(_kernel(rows), _HAT), mode="nearest"), dtype=np.float64)


def noise_gains(period_s: float, rows: int) -> tuple[float, float, float]:
    """Noise of matched values, velocity [1/s] and acceleration [1/s^2] for one unit of white noise."""
    differences = (_HAT, [0.5 / period_s, 0.0, -0.5 / period_s], np.array([1.0, -2.0, 1.0]) / period_s**2)
    values, velocity, acceleration = (float(np.linalg.norm(np.convolve(_kernel(rows), one))) for one in differences)
    return values, velocity, acceleration


def _kernel(rows: int) -> FloatArray:
    """K, (rows - 2,): the second sum of the weights of the parabola's curvature."""
    weights = np.cumsum(np.cumsum(parabola_weights(rows, 2)))[:-2]
    return np.asarray(weights / weights.sum(), dtype=np.float64)


def _filtered(values: FloatArray, period_s: float, order: int, smooth_s: float) -> FloatArray:
    """Derivative (n,) of an order; of fewer rows than the window by a parabola over those there are."""
    window = min(window_rows(period_s, smooth_s), (values.size - 1) | 1)
    if window < 3:
        return np.zeros(values.size) if order else values
    return parabola_filter(values, window, order, period_s)


def later_motion(moved: MeasuredMotion, rows: float) -> MeasuredMotion:
    """Motion `rows` after each row; half a row after it as a mean until the next one. The ends are held.

    Of weights (3,) over neighbours the first moment is the time t, -1 to 1, the second its square and the variance
    |t| (1 - |t|) / 3 of the mean, 1/12 for half a row.
    """
    if rows == 0.0:
        return moved
    whole = int(rows)
    t = rows - whole
    second = t**2 + abs(t) * (1.0 - abs(t)) / 3.0
    weights = np.array([0.5 * (second + t), 1.0 - second, 0.5 * (second - t)])  # of the row after, at, before
    last = moved.position.size - 1
    shifted = np.clip(np.arange(last + 1) + whole, 0, last)

    def at(values: FloatArray) -> FloatArray:
        return np.asarray(convolve1d(values[shifted], weights, mode="nearest"), dtype=np.float64)

    return MeasuredMotion(at(moved.position), at(moved.velocity), at(moved.acceleration), moved.direction)
