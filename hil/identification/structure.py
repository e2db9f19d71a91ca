"""Test for structure: does a residual depend on a quantity more than chance, with errors that count autocorrelation?

    m = A r,    W = m' (A R A')^-1 m,    F = W / (K - 1) * (v - K) / v     against F(K - 1, v - K)

A (K, n) averages the rows of each of K bins of the quantity, less the mean of all. R is the covariance of what the bin
means leave, by its spectrum (`hil.identification.spectrum`), and v its degrees of freedom (F. E. Satterthwaite,
Biometrics Bulletin 2 (1946) 110). Slow noise moves a whole bin, and is no structure.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from hil.arrays import FloatArray
from hil.identification.spectrum import spectrum

BINS = 10  # of a quantity: a bend, a step and a line show in them; twice as many for one that is asked by direction
_TAPER = 4  # Bartlett window in correlation times: it shortens the correlation by an eighth
_DECAYED = 0.05  # of the variance: the correlation time ends there
_NARROWEST = 0.2  # bin, over one of equal width
_NOISE = 4.0  # times the usual change from row to row: near an edge
# Times the rows near an edge over equally spread ones: a plateau; where a sine turns there are twice as many.
_DENSE = 3.0
_FEWEST_INDEPENDENT = 2.0  # independent rows per bin, below which nothing is told


class ResidualSeries(NamedTuple):
    """A residual (n,) of one recording, the rows (n,) that count, and those in which the twin sticks."""

    left: FloatArray
    rows: NDArray[np.bool_]
    sticks: NDArray[np.bool_] | None = None

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Rows (n,) in which the twin does not stick: there its residual is no torque that it lacks."""
        return np.ones(self.left.size, dtype=bool) if self.sticks is None else ~self.sticks


@dataclass(frozen=True, eq=False)
class Structure:
    """Dependence of a residual on a quantity: bin edges (K + 1,), means and their errors (K,), by chance `p`.

    `energy` is the mean square of the means over all rows, less what chance makes of it.
    """

    edges: FloatArray
    means: FloatArray
    errors: FloatArray
    energy: float
    p: float

    def at(self, quantity: FloatArray) -> FloatArray:
        """Mean (n,) of the residual at values of the quantity (n,)."""
        return np.asarray(self.means[_bin(quantity, self.edges)])


def structure(parts: Sequence[ResidualSeries], quantity: Sequence[FloatArray], bins: int = BINS) -> Structure | None:
    """Structure of residuals over a quantity, (n,) for each part, in as many bins as there are independent rows for.

    None where these are too few. Bins have equally many rows, but are not narrower than a fifth of equal ones, and no
    edge is within a plateau of the quantity: which of its rows are beyond is the pattern of its counts, and the noise
    of a loop, which the residual has, too.
    """
    few = sum(np.count_nonzero(part.rows) for part in parts) < bins
    while bins > 1 and not few:
        found = _structure(parts, quantity, bins)
        if found:
            return found
        bins = 4 * bins // 5
    return None


def _structure(parts: Sequence[ResidualSeries], quantity: Sequence[FloatArray], bins: int) -> Structure | None:
    values = np.concatenate([one[part.rows] for one, part in zip(quantity, parts, strict=True)])
    if values.size < bins or not np.isfinite(values).all():
        return None
    edges = _edges([one[part.rows] for one, part in zip(quantity, parts, strict=True)], bins)
    count = edges.size - 1
    if count < 2:
        return None
    where = [_bin(one, edges) for one in quantity]
    rows = _sums(parts, where, [part.rows.astype(np.float64) for part in parts], count)
    mean = _sums(parts, where, [part.left for part in parts], count) / np.maximum(rows, 1.0)
    noise = [np.where(part.rows, part.left - mean[at], 0.0) for part, at in zip(parts, where, strict=True)]
    share = rows / rows.sum()
    mean -= share @ mean
    inside = [[part.rows & (at == number) for part, at in zip(parts, where, strict=True)] for number in range(count)]
    fitted = [[one / max(row, 1.0) ** 0.5 for one in each] for each, row in zip(inside, rows, strict=True)]
    # the mean of all rows is no structure
    apart = [
        [one / max(row, 1.0) - part.rows / rows.sum() for one, part in zip(each, parts, strict=True)]
        for each, row in zip(inside, rows, strict=True)
    ]
    covariance, independent = spectrum(noise, fitted, [part.rows for part in parts]).covariance(apart)
    if not np.trace(covariance) > 0.0 or independent < _FEWEST_INDEPENDENT * count:
        return None
    axes, size, _ = np.linalg.svd(covariance)
    freed = independent - count
    contrast = (axes.T @ mean)[:-1] ** 2 / size[:-1]
    ratio = float(contrast.sum()) / (count - 1) * freed / independent
    errors = np.sqrt(np.diag(covariance))
    energy = float(share @ (mean**2 - errors**2))
    return Structure(edges, mean, errors, energy, float(fdtrc(count - 1, freed, ratio)))


def offset(parts: Sequence[ResidualSeries]) -> Structure | None:
    """Mean of residuals over all rows, as a structure of one bin; None where there are too few independent rows."""
    left = np.concatenate([part.left[part.rows] for part in parts])
    if not left.size:
        return None
    mean, rows = float(left.mean()), left.size
    noise = [np.where(part.rows, part.left - mean, 0.0) for part in parts]
    counted = [part.rows for part in parts]
    whole = [at / rows for at in counted]
    covariance, independent = spectrum(noise, [[rows**0.5 * one for one in whole]], counted).covariance([whole])
    if not covariance[0, 0] > 0.0 or independent < _FEWEST_INDEPENDENT:
        return None
    variance = float(covariance[0, 0])
    p = float(fdtrc(1, independent, mean**2 / variance))
    edges = np.array([-np.inf, np.inf])
    return Structure(edges, np.array([mean]), np.array([variance**0.5]), mean**2 - variance, p)


def autocovariance(parts: Sequence[ResidualSeries]) -> FloatArray:
    """Autocovariance (l,) of residuals over the rows that count, until it has decayed, tapered."""
    longest = max(part.left.size for part in parts)
    size = 1 << (2 * longest - 1).bit_length()
    products, pairs = np.zeros(size // 2 + 1), np.zeros(size // 2 + 1)
    for part in parts:
        products += np.abs(np.fft.rfft(np.where(part.rows, part.left, 0.0), size)) ** 2
        pairs += np.abs(np.fft.rfft(part.rows.astype(np.float64), size)) ** 2
    half = max(longest // 2, 1)
    covariance = np.fft.irfft(products, size)[:half] / np.maximum(np.fft.irfft(pairs, size)[:half].round(), 1.0)
    decayed = np.flatnonzero(covariance <= _DECAYED * covariance[0])
    length = min(_TAPER * max(int(decayed[0]) if decayed.size else half, 1), half)
    return np.asarray(covariance[:length] * (1.0 - np.arange(length) / length))


def _edges(quantity: Sequence[FloatArray], bins: int) -> FloatArray:
    """Edges (K + 1,) of at most so many bins of a quantity, (n,) for each part.

    An edge within a plateau goes into the gap to the edge beside it, if there is one.
    """
    values = np.sort(np.concatenate(quantity))
    wanted = np.quantile(values, np.linspace(0.0, 1.0, bins + 1))
    range_ = float(wanted[-1] - wanted[0])
    least = _NARROWEST * range_ / bins
    changes = np.concatenate([np.abs(np.diff(one)) for one in quantity])
    near = max(least, _NOISE * float(np.median(changes))) if changes.size else least

    def below(edge: float) -> int:
        return int(np.searchsorted(values, edge))

    def stands(edge: float, last: float) -> bool:
        """True outside of plateaus, where the bin from the last edge on, and the rest, have width and rows."""
        wide = edge - last > least and wanted[-1] - edge > least
        filled = min(below(edge) - below(last), values.size - below(edge)) > 0.5 * values.size / bins
        dense = (below(edge + near) - below(edge - near)) * range_ > _DENSE * 2.0 * near * values.size
        return wide and filled and not dense

    kept = [float(wanted[0])]
    for before, edge, after in zip(wanted, wanted[1:], wanted[2:], strict=False):
        gaps = [0.5 * (edge + other) for other in (before, after) if abs(other - edge) > 2.0 * near]
        kept += [one for one in (edge, *gaps) if stands(one, kept[-1])][:1]
    return np.array([*kept, wanted[-1]])


def _bin(quantity: FloatArray, edges: FloatArray) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, quantity, side="right") - 1, 0, edges.size - 2)


def _sums(
    parts: Sequence[ResidualSeries], where: Sequence[NDArray[np.intp]], values: Sequence[FloatArray], count: int
) -> FloatArray:
    """Sums (K,) of values (n,) over the rows of each bin."""
    found = np.zeros(count)
    for part, at, one in zip(parts, where, values, strict=True):
        found += np.bincount(at[part.rows], weights=one[part.rows], minlength=count)
    return found
