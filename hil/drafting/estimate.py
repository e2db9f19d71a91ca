"""Least squares with standard errors that count what the model leaves."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hil.arrays import FloatArray
from hil.identification.inverse_dynamics import solve

BLOCKS = 10  # of consecutive rows, each left out once: few enough to be independent, enough for an error to 25 %


@dataclass(frozen=True)
class Estimate:
    """Value and standard error in the same unit, and how they were found."""

    value: float
    std_error: float
    how: str = ""

    @property
    def significant(self) -> bool:
        """True above three standard errors."""
        return abs(self.value) > 3.0 * self.std_error

    def scaled(self, factor: float) -> "Estimate":
        """The estimate in another unit."""
        return Estimate(factor * self.value, abs(factor) * self.std_error, self.how)


@dataclass(frozen=True)
class BenchValue:
    """A key of the bench file with its value, its unit and error, and how it was found."""

    key: str
    value: float | int | str
    error: str
    how: str = ""


@dataclass(frozen=True)
class BlockFit:
    """Estimates in the order of the regressors, and the share of the standard deviation that they leave."""

    estimates: tuple[Estimate, ...]
    left: float


def fit_blocks(regressors: Sequence[FloatArray], measured: FloatArray, how: Sequence[str] = ()) -> BlockFit:
    """Fit `measured` (n,) by columns (n,); the errors are those of the jackknife over blocks of rows.

    Residuals of a model that lacks something are correlated in time, so that the textbook formula is too small
    (B. Efron, The Jackknife, the Bootstrap and Other Resampling Plans, 1982, sec. 3).
    """
    columns = np.column_stack(regressors)
    fit = solve(columns, measured)
    edges = np.linspace(0, measured.size, BLOCKS + 1).astype(int)
    without = []
    for first, end in pairwise(edges):
        kept = np.r_[0:first, end : measured.size]
        if np.linalg.matrix_rank(columns[kept]) == columns.shape[1]:
            without.append(solve(columns[kept], measured[kept]).values)
    values = np.array(without)
    errors = np.sqrt((len(values) - 1) * np.var(values, axis=0)) if len(values) > 1 else np.abs(fit.values)
    errors = np.maximum(errors, fit.std_errors)
    texts = how or [""] * len(fit.values)
    estimates = (Estimate(float(v), float(e), t) for v, e, t in zip(fit.values, errors, texts, strict=True))
    residual = measured - columns @ fit.values
    return BlockFit(tuple(estimates), float(np.std(residual) / np.std(measured)))
