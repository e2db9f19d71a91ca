"""Windows of the derivatives of a measured motion: as short as the noise of its position allows."""

import numpy as np
from scipy.special import ndtri

from hil.arrays import FloatArray
from hil.identification.derivatives import SMOOTH_S, MeasuredMotion, matched_motion, noise_gains

NOISE_SHARE = 0.02  # of noise in the variance of the acceleration: it makes the inertia too small by this share
LONGEST_S = 0.35  # window of the derivatives: passes 2 Hz


def noiseless_motion(position: FloatArray, period_s: float) -> MeasuredMotion:
    """Motion (n,) of a position that no sensor measured: through the shortest window, a few rows."""
    return matched_motion(position, period_s, shortest_window(position, period_s))


def shortest_window(position: FloatArray, period_s: float) -> int:
    """Rows of the shortest window in which the acceleration of a position (n,) has little noise."""
    return quiet_window(position, position_noise(position)[1], period_s, 0.0)


def quiet_window(
    position: FloatArray, noise: float, period_s: float, shortest_s: float = SMOOTH_S, beside: float = np.inf
) -> int:
    """Rows of the shortest window in which the acceleration of a position (n,) has little `noise` [its unit].

    Little of the acceleration, and of a white one of the rms `beside` [unit/s^2] through the same window. Longer
    windows leave less motion between reversals.
    """
    window = best = max(round(shortest_s / period_s) | 1, 3)
    least = np.inf
    while least == np.inf or (window <= position.size // 4 and window * period_s <= LONGEST_S):
        inner = slice(window, -window) if position.size > 3 * window else slice(None)
        acceleration = matched_motion(position, period_s, window).acceleration[inner]
        passed, _, gain = noise_gains(period_s, window)
        share = (noise * gain) ** 2 / max(min(float(np.var(acceleration)), (beside * passed) ** 2), 1e-300)
        if share < least:
            best, least = window, share
        if share < NOISE_SHARE:
            break
        window = 2 * window - 1
    return best


def position_noise(position: FloatArray) -> tuple[float, float]:
    """White noise of a position (n,): of even motion, the lower quarter, and rms of all.

    From differences of the order that leaves less motion; one of order m has the variance (2 m)! / m!^2. Stamps that
    are uneven make the noise of fast motion larger than that of even motion.
    """
    differences = [
        np.diff(position, order) / np.sqrt(gain)
        for order, gain in ((4, 70.0), (8, 12870.0))
        if position.size > 2 * order
    ]
    even = min((float(np.quantile(np.abs(one), 0.25) / ndtri(0.625)) for one in differences), default=0.0)
    rms = min((float(np.sqrt(np.mean(one**2))) for one in differences), default=0.0)
    return even, rms
