"""Steps of the Levenberg-Marquardt method: robust loss, normal equations, damped step between bounds, update of the
Jacobian."""

import numpy as np
from scipy.optimize import lsq_linear

from hil.arrays import FloatArray

_BLOCK = 1 << 15  # rows of the Jacobian that stay in the cache of a core
_ROUNDS = 30  # of block pivoting, which ends within ten or does not end


def broyden(slopes: FloatArray, change: FloatArray, step: FloatArray, size: FloatArray) -> None:
    """Broyden update of the Jacobian, in place, by the change (m,) of the residuals over a step.

    Parameters are weighted by `size`.
    """
    along = size**2 * step
    missed = (change - slopes @ step) / float(step @ along)
    for column, share in enumerate(along):
        slopes[:, column] += share * missed


def robust_loss(residuals: FloatArray, soft: float) -> tuple[float, FloatArray | None]:
    """Sum of rho, and the weights sqrt(rho') of the rows; rho(z) = 2 soft^2 (sqrt(1 + z / soft^2) - 1)."""
    if not soft:
        return float(residuals @ residuals), None
    root = np.sqrt(1.0 + (residuals / soft) ** 2)
    return float(2.0 * soft**2 * np.sum(root - 1.0)), np.asarray(1.0 / np.sqrt(root), dtype=np.float64)


def normal_equations(
    slopes: FloatArray, residuals: FloatArray, weights: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """J^T W^2 J and J^T W^2 r in blocks of rows: a weighted copy of J takes much memory for a long recording."""
    normal, descent = np.zeros((slopes.shape[1],) * 2), np.zeros(slopes.shape[1])
    for start in range(0, residuals.size, _BLOCK):
        rows = slice(start, start + _BLOCK)
        block, part = slopes[rows], residuals[rows]
        if weights is not None:
            block, part = block * weights[rows, None], part * weights[rows]
        normal += block.T @ block
        descent += block.T @ part
    return normal, descent


def damped_step(
    normal: FloatArray, descent: FloatArray, damping: float, size: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """The damped step of the module's equation, between `low` and `high`."""
    scale = np.where(size > 0.0, size, 1.0)
    damped = normal / np.outer(scale, scale) + damping * np.eye(scale.size)
    values, vectors = np.linalg.eigh(damped)
    root = vectors * np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    target = np.linalg.solve(root, -descent / scale)
    free = np.linalg.solve(root.T, target)
    if np.all(free > low * scale) and np.all(free < high * scale):
        return np.asarray(free / scale, dtype=np.float64)
    inside = _bounded(root @ root.T, descent / scale, np.minimum(low, 0.0) * scale, np.maximum(high, 0.0) * scale)
    if inside is None:
        wide = np.maximum(high - low, 1e-12)
        inside = lsq_linear(
            root.T,
            target,
            (np.minimum(low, 0.0) * scale - 1e-12 * wide * scale, np.maximum(high, 0.0) * scale + 1e-12 * wide * scale),
            method="bvls",
        ).x
    return np.asarray(np.clip(inside / scale, low, high), dtype=np.float64)


def _bounded(matrix: FloatArray, slope: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray | None:
    """Minimise s^T A s / 2 + g^T s between bounds by block pivoting (Judice and Pires 1994); None if it does not end.

    All variables that pass a bound, or are held by one that they leave, change at once: some solutions of equations
    where bvls, which changes one at a time, takes hundreds for the edges of many windows.
    """
    at_low, at_high = np.zeros(slope.size, dtype=bool), np.zeros(slope.size, dtype=bool)
    for _ in range(_ROUNDS):
        held = at_low | at_high
        free = ~held
        step = np.where(at_low, low, np.where(at_high, high, 0.0))
        known = slope + matrix[:, held] @ step[held]
        try:
            step[free] = np.linalg.solve(matrix[np.ix_(free, free)], -known[free])
        except np.linalg.LinAlgError:  # singular but for rounding
            return None
        left = slope + matrix @ step
        lower = (at_low & (left >= 0.0)) | (free & (step < low))
        upper = (at_high & (left <= 0.0)) | (free & (step > high))
        if np.array_equal(lower, at_low) and np.array_equal(upper, at_high):
            return step
        at_low, at_high = lower, upper
    return None
