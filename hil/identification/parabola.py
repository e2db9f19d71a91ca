"""Parabolas through rows: the filter of Savitzky and Golay, and the step by which the first rows begin.

The filter is `scipy.signal.savgol_filter` of order 2 to the last bit. `scipy.signal` itself takes most of a second to
load, which a first look at a file must not wait for.
"""

from math import factorial

import numpy as np
from scipy.ndimage import convolve1d

from hil.arrays import FloatArray

_ORDER = 2
_FEWEST = 3  # rows of a parabola, through which there is always one
_FITS = 3.0  # times the noise, that a parabola leaves at most


def parabola_weights(rows: int, derivative: int, period_s: float = 1.0) -> FloatArray:
    """Weights (rows,) of a convolution that gives the derivative of the parabola in the middle of an odd window."""
    half = rows // 2
    powers = np.arange(half, -half - 1, -1.0) ** np.arange(_ORDER + 1).reshape(-1, 1)
    wanted = np.zeros(_ORDER + 1)
    wanted[derivative] = factorial(derivative) / period_s**derivative
    return np.asarray(np.linalg.lstsq(powers, wanted, rcond=None)[0], dtype=np.float64)


def parabola_filter(values: FloatArray, rows: int, derivative: int, period_s: float) -> FloatArray:
    """Derivative (n,) of values (n,) by parabolas over an odd window; at both ends by that of the last window."""
    found = np.asarray(convolve1d(values, parabola_weights(rows, derivative, period_s), mode="constant"))
    half, n = rows // 2, values.size
    for window, inner in ((slice(0, rows), slice(0, half)), (slice(n - rows, n), slice(n - half, n))):
        fit = np.polyder(np.polyfit(np.arange(float(rows)), values[window], _ORDER), derivative)
        at = np.arange(inner.start - window.start, inner.stop - window.start, dtype=np.float64)
        found[inner] = np.polyval(fit, at) / period_s**derivative
    return found


def first_step(values: FloatArray, noise: float) -> float:
    """Step by which values (n,) reach the first of them, by a parabola from there through as many as it fits.

    An axis that starts to move within the rows is on no parabola with them.
    """
    rows = values
    while np.ptp(rows) > 0.0:  # at rest the polynomial would give rounding errors
        at = np.arange(rows.size)
        curve, slope, first = np.polyfit(at, rows, 2)
        left = rows - (curve * at**2 + slope * at + first)
        if rows.size <= _FEWEST or float(np.sqrt(np.mean(left**2))) <= _FITS * noise:
            return float(slope - curve)
        rows = rows[:-1]
    return 0.0
