"""Steps of the Levenberg-Marquardt method: robust loss, damped step between bounds, update of the Jacobian."""

import numpy as np
from scipy.optimize import lsq_linear

from hil.arrays import FloatArray


def broyden(slopes: FloatArray, change: FloatArray, step: FloatArray, size: FloatArray) -> FloatArray:
    """Broyden update of the Jacobian by the change (m,) of the residuals over a step, parameters weighted by `size`."""
    along = size**2 * step
    return np.asarray(slopes + np.outer((change - slopes @ step) / float(step @ along), along), dtype=np.float64)


def robust_loss(residuals: FloatArray, soft: float) -> tuple[float, FloatArray | None]:
    """Sum of rho, and the weights sqrt(rho') of the rows; rho(z) = 2 soft^2 (sqrt(1 + z / soft^2) - 1)."""
    if not soft:
        return float(residuals @ residuals), None
    root = np.sqrt(1.0 + (residuals / soft) ** 2)
    return float(2.0 * soft**2 * np.sum(root - 1.0)), np.asarray(1.0 / np.sqrt(root), dtype=np.float64)


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
    wide = np.maximum(high - low, 1e-12)
    found = lsq_linear(
        root.T,
        target,
        (np.minimum(low, 0.0) * scale - 1e-12 * wide * scale, np.maximum(high, 0.0) * scale + 1e-12 * wide * scale),
        method="bvls",
    )
    return np.asarray(np.clip(found.x / scale, low, high), dtype=np.float64)
