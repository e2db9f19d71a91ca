"""Evidence for one regressor of a residual: generalised least squares, its error, and the chance of its ratio."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.identification.laps import Laps
from hil.identification.structure import ResidualSeries, autocovariance
from hil.identification.whitening import RANK, filtered, spread, whitening_filter

_UNDERFLOW = 1e-290  # probability below which its floating-point number loses digits


def log_tail(ratio: float, free: float) -> float:
    """Logarithm of the probability that Student's t exceeds a ratio >= 0, also where that is no floating-point number.

    There the first term of the incomplete beta function I_x(a, 1/2), x = free / (free + t^2), a = free / 2 (M.
    Abramowitz and I. Stegun, Handbook of Mathematical Functions, 26.5.4), with its series as 1 / (1 - x).
    """
    if (tail := float(student.sf(ratio, free))) > _UNDERFLOW:
        return math.log(tail)
    x, a = free / (free + ratio**2), 0.5 * free
    return float(a * math.log(x) - 0.5 * math.log1p(-x) - math.log(2.0 * a) - betaln(a, 0.5))


def first_coefficient(
    matrix: FloatArray, signal: FloatArray, rows: Sequence[NDArray[np.bool_]], laps: Sequence[Laps | None]
) -> tuple[float, float, float]:
    """Coefficient of the first column (n, p), the same over its error, and the degrees of freedom; 0 where not told.

    Generalised least squares: both sides are whitened by the autoregressive model of what the columns leave, so that
    slow errors do not hide a shape that is faster. The error counts what is correlated still (D. W. K. Andrews and J.
    C. Monahan, Econometrica 60 (1992) 953), and what repeats from lap to lap, as the counts of an encoder do: a lap
    tells it no better than one. Rows (m,) of each run count.
    """
    whole = np.column_stack([signal, matrix])
    taps = whitening_filter(signal, matrix, rows)
    signal, *columns = (filtered(one, rows, taps) for one in whole.T)
    matrix = np.column_stack(columns)
    scale = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(scale > 0.0, scale, 1.0)
    basis, upper = np.linalg.qr(scaled)  # an orthonormal basis: the singular values are those of a small matrix
    weights = np.linalg.pinv(upper, rcond=RANK) @ basis.T
    solved = weights @ signal
    own = upper[:, 0] - upper[:, 1:] @ np.linalg.lstsq(upper[:, 1:], upper[:, 0], rcond=RANK)[0]
    if float(own @ own) < RANK:  # the others make it
        return 0.0, 0.0, 0.0
    splits = np.cumsum([int(at.sum()) for at in rows])[:-1]
    residual = np.split(signal - scaled @ solved, splits)
    parts = [ResidualSeries(spread(left, at), at) for left, at in zip(residual, rows, strict=True)]
    covariance = autocovariance(parts)
    variance = 0.0
    for weight, at in zip(np.split(weights[0], splits), rows, strict=True):
        size = 1 << (2 * at.size - 1).bit_length()
        products = np.fft.irfft(np.abs(np.fft.rfft(spread(weight, at), size)) ** 2, size)[: covariance.size]
        lags = covariance[: products.size]
        variance += float(lags[0] * products[0] + 2.0 * lags[1:] @ products[1 : lags.size])
    repeated = 1.0 + _repeated(parts, np.split(weights[0], splits), laps) / variance if variance > 0.0 else 1.0
    variance *= repeated
    total = repeated * max(float(covariance[0] + 2.0 * covariance[1:].sum()), float(covariance[0]))
    free = signal.size * float(covariance[0]) / total - matrix.shape[1] if total > 0.0 else 0.0
    if not (variance > 0.0 and free > 0.0):
        return 0.0, 0.0, 0.0
    return float(solved[0] / scale[0]) if scale[0] > 0.0 else 0.0, float(solved[0]) / variance**0.5, free


def _repeated(parts: Sequence[ResidualSeries], weights: Sequence[FloatArray], laps: Sequence[Laps | None]) -> float:
    """Variance that a sum of residuals with weights (m,) of the rows has because these repeat from lap to lap."""
    found = 0.0
    for part, weight, of in zip(parts, weights, laps, strict=True):
        if of is None:
            continue
        both = part.rows[of.first] & part.rows[of.again]
        first, again, series = of.first[both], of.again[both], spread(weight, part.rows)
        if first.size:
            alike = max(float(np.mean(part.left[first] * part.left[again])), 0.0)
            found += 2.0 * alike * max(float(series[first] @ series[again]), 0.0)
    return found
