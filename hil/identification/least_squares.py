"""Linear least squares with standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Solution of min |y - W x|^2; errors by the textbook formula for independent, equal residuals.

    values, std_errors (p,), in the units of x; residual_rms in the unit of y; relative_error |y - W x| / |y|.
    """

    values: FloatArray
    std_errors: FloatArray
    residual_rms: float
    relative_error: float


def solve(regressors: FloatArray, measured: FloatArray) -> LinearFit:
    """Fit `measured` (n,) by columns of `regressors` (n, p), n > p, of full rank.

    x = (W'W)^-1 W'y,  s^2 = |y - W x|^2 / (n - p),  std errors^2 = s^2 diag (W'W)^-1.
    """
    rows, columns = regressors.shape
    # QR instead of W'W keeps the digits of badly scaled columns
    q, r = np.linalg.qr(regressors)
    values = np.linalg.solve(r, q.T @ measured)
    residual = measured - regressors @ values
    variance = float(residual @ residual) / (rows - columns)
    std_errors = np.sqrt(variance * np.sum(np.linalg.inv(r) ** 2, axis=1))
    return LinearFit(
        values,
        std_errors,
        float(np.sqrt(np.mean(residual**2))),
        float(np.linalg.norm(residual) / np.linalg.norm(measured)),
    )
