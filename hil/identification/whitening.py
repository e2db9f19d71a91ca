"""Whitening for least squares: a filter that turns the residual into white noise.

A slow residual, such as that of a wrong friction law, then hides no faster effect.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from hil.arrays import FloatArray
from hil.identification.spectrum import Rows
from hil.identification.structure import ResidualSeries, autocovariance

RANK = 1e-9  # share of a column, beside the others, below which it is not told
_ORDER = 24  # of the autoregressive model: as that of `hil.identification.inference`
_RIDGE = 1e-4  # of white noise in the autocovariance: a filter that takes off a hundredth of the rms is far enough


def whitening_filter(signal: FloatArray, columns: FloatArray, rows: Rows) -> FloatArray:
    """Prediction-error filter (k,) of what columns (m, p) leave of a signal (m,), on the `rows` (n,) of each run."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    basis, upper = np.linalg.qr(scaled)
    left = signal - scaled @ (np.linalg.pinv(upper, rcond=RANK) @ (basis.T @ signal))
    parts = np.split(left, np.cumsum([int(at.sum()) for at in rows])[:-1])
    covariance = autocovariance([ResidualSeries(spread(one, at), at) for one, at in zip(parts, rows, strict=True)])
    order = min(_ORDER, covariance.size - 1)
    if order < 1 or not covariance[0] > 0.0:
        return np.ones(1)
    covariance[0] *= 1.0 + _RIDGE
    return np.concatenate([[1.0], -solve_toeplitz(covariance[:order], covariance[1 : order + 1])])


def filtered(values: FloatArray, rows: Rows, taps: FloatArray) -> FloatArray:
    """Values (m,) of the rows that count, filtered run by run; between stretches of rows they go on evenly."""
    found = []
    for one, at in zip(np.split(values, np.cumsum([int(at.sum()) for at in rows])[:-1]), rows, strict=True):
        if one.size:
            even = one if one.size == at.size else np.interp(np.arange(at.size), np.flatnonzero(at), one)
            found.append(np.convolve(even, taps)[: at.size][at])
    return np.concatenate([*found, np.zeros(0)])


def spread(values: FloatArray, at: NDArray[np.bool_]) -> FloatArray:
    """Values of the rows that count as a series (n,), 0 in the others."""
    series = np.zeros(at.size)
    series[at] = values
    return series
