"""Coefficients of least squares whose errors are correlated, and the chance of a ratio to its error.

Generalised least squares: both sides are whitened by the autoregressive model of what the columns leave, so that slow
errors do not hide a shape that is faster. The error counts what is correlated still (D. W. K. Andrews and J. C.
Monahan, Econometrica 60 (1992) 953), and what repeats from lap to lap, as the counts of an encoder do: a lap tells it
no better than one.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.identification.laps import Laps
from hil.identification.spectrum import spectrum
from hil.identification.structure import ResidualSeries
from hil.identification.whitening import RANK, filtered, spread, whitening_filter

_UNDERFLOW = 1e-290  # probability below which its floating-point number loses digits


class Coefficient(NamedTuple):
    """Value of a coefficient, the same over its error, and degrees of freedom of the error; 0 where not told."""

    value: float = 0.0
    ratio: float = 0.0
    free: float = 0.0


def coefficients(
    matrix: FloatArray, signal: FloatArray, rows: Sequence[NDArray[np.bool_]], laps: Sequence[Laps | None], count: int
) -> list[Coefficient]:
    """The first `count` coefficients of columns (n, p) in a signal (n,); rows (m,) of each run count."""
    whole = np.column_stack([signal, matrix])
    taps = whitening_filter(signal, matrix, rows)
    signal, *columns = (filtered(one, rows, taps) for one in whole.T)
    matrix = np.column_stack(columns)
    scale = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(scale > 0.0, scale, 1.0)
    basis, upper = np.linalg.qr(scaled)  # an orthonormal basis: the singular values are those of a small matrix
    weights = np.linalg.pinv(upper, rcond=RANK) @ basis.T
    solved = weights @ signal
    splits = np.cumsum([int(at.sum()) for at in rows])[:-1]

    def by_run(values: FloatArray) -> list[FloatArray]:
        return [spread(part, at) for part, at in zip(np.split(values, splits), rows, strict=True)]

    left, beside = by_run(signal - scaled @ solved), [by_run(one) for one in basis.T]
    noise = spectrum(left, beside, rows)
    parts = [ResidualSeries(one, at) for one, at in zip(left, rows, strict=True)]

    def coefficient(index: int) -> Coefficient:
        others = np.delete(upper, index, axis=1)
        own = upper[:, index] - others @ np.linalg.lstsq(others, upper[:, index], rcond=RANK)[0]
        if float(own @ own) < RANK:  # the others make it
            return Coefficient()
        weight = by_run(weights[index])
        covariance, free = noise.covariance([weight])
        variance = float(covariance[0, 0])
        if not variance > 0.0:
            return Coefficient()
        repeated = 1.0 + _repeated(parts, weight, laps) / variance
        value = float(solved[index])
        free = min(free, max(float(signal.size - matrix.shape[1]), 1.0)) / repeated
        return Coefficient(value / scale[index], value / (repeated * variance) ** 0.5, free)

    return [coefficient(index) for index in range(count)]


def log_tail(ratio: float, free: float) -> float:
    """Logarithm of the probability that Student's t exceeds a ratio >= 0, also where that is no floating-point number.

    There the first term of the incomplete beta function I_x(a, 1/2), x = free / (free + t^2), a = free / 2 (M.
    Abramowitz and I. Stegun, Handbook of Mathematical Functions, 26.5.4), with its series as 1 / (1 - x).
    """
    if (tail := float(student.sf(ratio, free))) > _UNDERFLOW:
        return math.log(tail)
    x, a = free / (free + ratio**2), 0.5 * free
    return float(a * math.log(x) - 0.5 * math.log1p(-x) - math.log(2.0 * a) - betaln(a, 0.5))


def _repeated(parts: Sequence[ResidualSeries], weights: Sequence[FloatArray], laps: Sequence[Laps | None]) -> float:
    """Variance that a sum of residuals with weights (n,) has because these repeat from lap to lap."""
    found = 0.0
    for part, weight, of in zip(parts, weights, laps, strict=True):
        if of is None:
            continue
        both = part.rows[of.first] & part.rows[of.again]
        first, again = of.first[both], of.again[both]
        if first.size:
            alike = max(float(np.mean(part.left[first] * part.left[again])), 0.0)
            found += 2.0 * alike * max(float(weight[first] @ weight[again]), 0.0)
    return found
