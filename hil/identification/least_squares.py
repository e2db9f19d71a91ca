"""Linear least squares on named columns, with standard errors that count correlated residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from hil.arrays import FloatArray

BLOCKS = 10  # of consecutive rows, each left out once: few enough to be independent, enough for an error to 25 %
SIGMAS = 3.0  # standard errors from which a value differs from 0
_RANK = 1e-9  # of the largest singular value of the scaled columns: below, a combination of columns is not told
_NOISY = 10.0  # power of a combination of columns over that of noise in it, below which it is not told
_REWEIGHTED = 40  # iterations of least absolute deviations

Columns = Mapping[str, FloatArray]  # regressors (n,) by the name of their coefficient


@dataclass(frozen=True)
class Estimate:
    """Value and standard error in the same unit, and how they were found."""

    value: float
    std_error: float
    how: str = ""

    @property
    def significant(self) -> bool:
        """True above three standard errors."""
        return abs(self.value) > SIGMAS * self.std_error

    def scaled(self, factor: float) -> "Estimate":
        """The estimate in another unit."""
        return Estimate(factor * self.value, abs(factor) * self.std_error, self.how)


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Coefficients (p,) with standard errors, and the residual (n,).

    The error of a coefficient that the columns do not tell is infinite, and its value the smallest one. `left` is the
    standard deviation of the residual over that of the fitted values, `relative_error` the ratio of their norms.
    """

    names: tuple[str, ...]
    values: FloatArray
    std_errors: FloatArray
    covariance: FloatArray  # (p, p) of the combinations that are told
    residual: FloatArray
    left: float
    relative_error: float
    held_out: float = 0.0  # sum of squares of the blocks, each predicted by the fit without it
    how: str = ""

    def __getitem__(self, name: str) -> Estimate:
        at = self.names.index(name)
        return Estimate(float(self.values[at]), float(self.std_errors[at]), self.how)

    def differs(self, names: Sequence[str]) -> bool:
        """True where coefficients together differ from 0 by three standard errors each (Wald)."""
        at = [self.names.index(name) for name in names]
        wald = self.values[at] @ np.linalg.pinv(self.covariance[np.ix_(at, at)]) @ self.values[at]
        return bool(np.isfinite(self.std_errors[at]).all() and wald > len(at) * SIGMAS**2)

    @property
    def share(self) -> float:
        """Share of the variance that is explained."""
        return 1.0 - self.left**2

    def predict(self, columns: Columns) -> FloatArray:
        """Values (n,) of the fit on other columns."""
        return np.asarray(sum(value * columns[name] for name, value in zip(self.names, self.values, strict=True)))


def least_squares(
    columns: Columns,
    measured: FloatArray,
    *,
    blocks: int = BLOCKS,
    rows_per_sample: float = 1.0,
    noise: Mapping[str, float] | None = None,
    how: str = "",
) -> LinearFit:
    """Fit `measured` (n,) by columns (n,), of which `noise` is the standard deviation of white noise in each.

    Residuals of a model that lacks something are correlated in time, so that the textbook formula is too small. The
    error is that of the jackknife over blocks of rows (B. Efron, The Jackknife, the Bootstrap and Other Resampling
    Plans, 1982, sec. 3), or that of the textbook with one independent sample in `rows_per_sample` rows, whichever is
    larger. Without `blocks` it is the latter alone. A column with `noise` that differs from a combination of the others
    by noise, to a tenth of its power, so that its value would be too small by a tenth, is not told: see `_without`.
    """
    for name in noise or {}:
        if (fit := _without(name, columns, measured, blocks, rows_per_sample, noise or {}, how)) is not None:
            return fit
    matrix = np.column_stack(list(columns.values()))
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    u, size, v = np.linalg.svd(matrix / scale, full_matrices=False)
    told = size > _RANK * size[0]
    u, root = u[:, told], v[told].T / size[told] / scale[:, None]  # values = root u' measured
    values = root @ (u.T @ measured)
    residual = measured - matrix @ values
    free = measured.size / rows_per_sample - told.sum()
    variance = float(residual @ residual) / free if free > 0.0 else np.inf
    errors = np.sqrt(variance * np.sum(root**2, axis=1))
    changes, held_out = [], 0.0
    for first, end in pairwise(np.linspace(0, measured.size, min(blocks, measured.size) + 1).astype(int)):
        without = np.eye(u.shape[1]) - u[first:end].T @ u[first:end]
        if not told.any() or np.linalg.eigvalsh(without)[0] > _RANK:
            change = np.linalg.solve(without, u[first:end].T @ residual[first:end])
            changes.append(root @ change)
            held_out += float(np.sum((residual[first:end] + u[first:end] @ change) ** 2))
        else:  # no other block tells all that this one does
            held_out = np.inf
    together = root @ root.T
    if len(changes) > 1:
        errors = np.maximum(errors, np.sqrt((len(changes) - 1) * np.var(changes, axis=0)))
        together = np.cov(changes, rowvar=False, bias=True).reshape(together.shape)
    single = np.sqrt(np.diag(together))
    correlation = together / np.outer(*2 * (np.where(single > 0.0, single, 1.0),))
    covariance = correlation * np.outer(errors, errors)
    errors[np.sum(v[told] ** 2, axis=0) < 1.0 - _RANK] = np.inf
    spread, norm = float(np.std(measured)), float(np.linalg.norm(measured))
    return LinearFit(
        tuple(columns),
        values,
        errors,
        covariance,
        residual,
        float(np.std(residual)) / spread if spread > 0.0 else 1.0,
        float(np.linalg.norm(residual)) / norm if norm > 0.0 else 1.0,
        held_out,
        how,
    )


def _without(
    name: str,
    columns: Columns,
    measured: FloatArray,
    blocks: int,
    rows_per_sample: float,
    noise: Mapping[str, float],
    how: str,
) -> LinearFit | None:
    """Fit without a column that is not told beside the others, its coefficient 0; None where it is told.

    Its error is that of all of `measured` in it, and that of the others counts what they would take over.
    """
    column, others = columns[name], {key: one for key, one in columns.items() if key != name}
    matrix, size = np.column_stack(list(others.values())), float(np.linalg.norm(column))
    alike = np.linalg.lstsq(matrix, column, rcond=_RANK)[0]
    own = column - matrix @ alike
    power = float(own @ own)
    full = np.column_stack([matrix, own])
    left = measured - full @ np.linalg.lstsq(full, measured, rcond=_RANK)[0]
    most, free = float(np.linalg.norm(measured)) / size if size else np.inf, measured.size / rows_per_sample
    vague = float(left @ left) > free * power * most**2
    if size and power > _NOISY * measured.size * noise[name] ** 2 and not vague:
        return None
    told = {key: one for key, one in noise.items() if key != name}
    fit = least_squares(others, measured, blocks=blocks, rows_per_sample=rows_per_sample, noise=told, how=how)
    at, kept = list(columns).index(name), np.array([key != name for key in columns])
    values, errors, covariance = np.zeros(kept.size), np.full(kept.size, most), np.zeros((kept.size, kept.size))
    norm, sizes = float(np.linalg.norm(measured)), np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    taken = np.minimum(np.abs(alike) * most, norm / sizes) if size else 0.0
    values[kept], errors[kept] = fit.values, np.hypot(fit.std_errors, taken)
    covariance[np.ix_(kept, kept)], errors[at] = fit.covariance, most
    return replace(fit, names=tuple(columns), values=values, std_errors=errors, covariance=covariance)


def least_absolute(columns: Columns, measured: FloatArray, weights: FloatArray) -> FloatArray:
    """Part (n,) of `measured` (n,) that columns (n,) explain with the least sum of weights (n,) times |deviation|.

    Windows of another level do not shift it. Iteratively reweighted least squares (E. J. Schlossmacher, Journal of the
    American Statistical Association 68, 1973). At least one weight is positive.
    """
    matrix = np.column_stack(list(columns.values()))
    matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    weight, found = weights, measured
    for _ in range(_REWEIGHTED):
        solved, *_ = np.linalg.lstsq(matrix * weight[:, None], measured * weight, rcond=_RANK)
        found = matrix @ solved
        left = np.abs(measured - found)
        least = 1e-3 * float(np.median(left[weights > 0.0])) + 1e-300
        weight = weights / np.sqrt(np.maximum(left, least))
    return np.asarray(found, dtype=np.float64)
