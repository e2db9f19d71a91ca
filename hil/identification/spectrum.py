"""Noise of weighted sums of a residual, by its spectrum: what wanders slowly is known by few values.

    cov(sum u r, sum w r) = sum over bands b of S_b (u, w)_b,    S_b = (r, r)_b / (m_b - h_b)

(u, w)_b is the product of two series within band b, m_b its independent values, h_b those that fitted columns take of
it. The sum of few slow values has few degrees of freedom (F. E. Satterthwaite, Biometrics Bulletin 2 (1946) 110):
friction that wanders tells little of a shape as slow, however many rows there are. What wanders through most of a
recording is no noise that its rows can tell. Rows that do not count smear S_b over its neighbours, which is undone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, polygamma

from hil.arrays import FloatArray

_LEAST = 8.0  # independent values of a band: their variance is known to a half
_WIDTH = 2.0  # upper over lower frequency of a band: octaves

_ROUNDS = 5  # of a sharpening: more make noise of it

Series = Sequence[FloatArray]  # (n,) of each run, 0 in rows that do not count
Rows = Sequence[NDArray[np.bool_]]  # that count, (n,) of each run


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Variance (b,) of a residual in each band, and the independent values (b,) that tell it.

    `rows` count; `size` ordinates, `first` (b,) of each band.
    """

    variance: FloatArray
    independent: FloatArray
    rows: int
    size: int
    first: NDArray[np.intp]

    def covariance(self, weights: Sequence[Series]) -> tuple[FloatArray, float]:
        """Covariance (k, k) of the sums of k weights times the noise, and the mean of their degrees of freedom."""
        widths = np.diff(np.append(self.first, self.size // 2 + 1))
        sizes = _both_signs(self.size) * np.repeat(self.variance, widths) / self.size
        found, of_bands = np.zeros((len(weights), len(weights))), np.zeros(self.first.size)
        for runs in zip(*weights, strict=True):
            transform = np.fft.rfft(np.stack(runs), self.size)
            scaled = transform * sizes
            found += scaled.real @ transform.real.T + scaled.imag @ transform.imag.T
            own = np.sum(scaled.real * transform.real + scaled.imag * transform.imag, axis=0)
            of_bands += np.add.reduceat(own, self.first)
        free = float(of_bands.sum() ** 2 / max(float(np.sum(of_bands**2 / self.independent)), 1e-300))
        return found, min(free, self.rows)


def spectrum(residual: Series, columns: Sequence[Series], counted: Rows) -> NoiseSpectrum:
    """Spectrum of a residual, of the rows `counted` (n,) in each run, one at least in all.

    `columns` that were fitted are orthonormal over all runs.
    """
    rows = int(sum(at.sum() for at in counted))
    size = 1 << (max(one.size for one in residual) - 1).bit_length()
    least, edges = 0.5 * _LEAST / rows * size, [0.0]
    while edges[-1] + least < size // 2:
        edges.append(max(_WIDTH * edges[-1], edges[-1] + least))
    first = np.unique(np.ceil(np.array(edges[:-1] or edges)).astype(np.intp))
    taken = sum((_energy(runs, size, first) for runs in zip(*columns, strict=True)), np.zeros(first.size))
    independent = np.maximum(rows * np.add.reduceat(_both_signs(size), first) / size - taken, 1.0)
    variance, told = _moderated(_energy(residual, size, first) / independent, independent)
    return NoiseSpectrum(_sharpened(variance, counted, size, first), told, rows, size, first)


def _sharpened(variance: FloatArray, counted: Rows, size: int, first: NDArray[np.intp]) -> FloatArray:
    """Variances (b,) of bands which, smeared by the rows that do not count, are the given ones.

    W. H. Richardson, Bayesian-based iterative method of image restoration, J. Opt. Soc. Am. 62 (1972) 55.
    """
    seen = np.fft.irfft(np.sum([np.abs(np.fft.rfft(at, size)) ** 2 for at in counted], axis=0), size)
    both, widths = _both_signs(size), np.diff(np.append(first, size // 2 + 1))
    ordinates, found = np.add.reduceat(both, first), variance
    for _ in range(_ROUNDS):
        smeared = np.fft.rfft(np.fft.irfft(np.repeat(found, widths), size) * seen / seen[0]).real
        found = found * variance / np.maximum(np.add.reduceat(both * smeared, first) / ordinates, 1e-300)
    return found


def _moderated(variance: FloatArray, independent: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Variances (b,) of bands drawn to their common value as far as all of them have one, and what tells them.

    Where the scatter of their logarithms is that of chance, every band tells each: G. K. Smyth, Linear models and
    empirical Bayes methods, Statistical Applications in Genetics and Molecular Biology 3 (2004) 3.
    """
    known = variance > 0.0
    if np.count_nonzero(known) < 2:
        return variance, independent
    half = 0.5 * independent[known]
    logarithm = np.log(variance[known]) - digamma(half) + np.log(half)
    scatter = float(np.var(logarithm, ddof=1)) - float(np.mean(polygamma(1, half)))
    total = float(independent.sum())
    common = total if scatter <= polygamma(1, 0.5 * total) else 2.0 * _inverse_trigamma(scatter)
    level = float(np.exp(np.mean(logarithm) + digamma(0.5 * common) - np.log(0.5 * common)))
    told = independent + common
    return (common * level + independent * variance) / told, np.minimum(told, total)


def _inverse_trigamma(value: float) -> float:
    """x with trigamma(x) = value, by Newton's method from Smyth's start."""
    x = 0.5 + 1.0 / value
    for _ in range(20):
        slope = float(polygamma(1, x))
        x += slope * (1.0 - slope / value) / float(polygamma(2, x))
    return x


def _both_signs(size: int) -> FloatArray:
    """Ordinates of both signs at each frequency (f,)."""
    both = np.full(size // 2 + 1, 2.0)
    both[0] = both[-1] = 1.0
    return both


def _energy(series: Series, size: int, first: NDArray[np.intp]) -> FloatArray:
    """Energy (b,) of a series within each band, or of several of one run."""
    alike = len({one.size for one in series}) == 1
    each = np.fft.rfft(np.stack(series), size) if alike else [np.fft.rfft(one, size) for one in series]
    found = np.sum([part.real**2 + part.imag**2 for part in each], axis=0)
    return np.asarray(np.add.reduceat(_both_signs(size) * found, first) / size)
