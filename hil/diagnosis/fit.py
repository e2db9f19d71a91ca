"""Prediction-error fit of a hypothesis (Ljung 1999, ch. 7), with scipy's trust region.

    min over x of  sum rho(r(x)^2),   r: weighted residuals of all channels and runs

The Jacobian is taken by differences, one simulation per parameter, on all cores: the kernel releases
the interpreter. A first pass with a soft loss keeps a few wild instants from steering the start.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hil.diagnosis.model import Model
from hil.measured import Measured

FloatArray = NDArray[np.float64]
Result = TypeVar("Result")

POOL = ThreadPoolExecutor(os.cpu_count() or 1)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted hypothesis: its vector, weighted residuals, Jacobian, and cost = sum r^2.

    `splits` are the rows at which the residuals of the next channel or run begin.
    """

    model: Model
    x: FloatArray
    residuals: FloatArray
    jacobian: FloatArray
    splits: tuple[int, ...]

    @property
    def cost(self) -> float:
        """Sum of squared weighted residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def reduced(self) -> float:
        """Mean squared weighted residual: 1 at the noise floor."""
        return self.cost / self.residuals.size


def jacobian(model: Model, x: FloatArray, base: FloatArray, runs: Sequence[Measured], *,
             closed: bool = False) -> FloatArray:
    """Derivative of the weighted residuals (m, parameters) by forward differences, columns in parallel."""
    _, high = model.bounds()

    def column(index: int) -> FloatArray:
        step = model.coordinates[index].step
        if x[index] + step > high[index]:
            step = -step
        moved = x.copy()
        moved[index] += step
        return (model.residuals(moved, runs, closed) - base) / step

    return np.stack(list(POOL.map(column, range(x.size))), axis=1)


def fit(model: Model, runs: Sequence[Measured], x: FloatArray | None = None, *, soft: float = 0.0,
        evaluations: int = 30, closed: bool = False) -> Fit:
    """Fit all coordinates of a model, from `x` or the model's own start.

    `soft` > 0 is the size of residual from which the loss grows only linearly. `closed` takes the residuals of
    the closed loop instead of those of the blocks.
    """
    low, high = model.bounds()
    start = np.clip(model.initial() if x is None else x, low + 1e-9, high - 1e-9)
    last: dict[str, FloatArray] = {}

    def residuals(at: FloatArray) -> FloatArray:
        last["x"], last["r"] = at.copy(), model.residuals(at, runs, closed)
        return last["r"]

    def derivative(at: FloatArray) -> FloatArray:
        base = last["r"] if np.array_equal(last["x"], at) else residuals(at)
        return jacobian(model, at, base, runs, closed=closed)

    found = least_squares(residuals, start, derivative, bounds=(low, high), x_scale="jac", max_nfev=evaluations,
                          loss="soft_l1" if soft else "linear", f_scale=soft or 1.0, xtol=1e-7, ftol=1e-6, gtol=1e-8)
    base = model.residuals(found.x, runs, closed)
    slope = found.jac if not soft else jacobian(model, found.x, base, runs, closed=closed)
    return Fit(model, found.x, base, slope, splits(model, runs, closed))


def splits(model: Model, runs: Sequence[Measured], closed: bool = False) -> tuple[int, ...]:
    """Where the residuals of one channel of one run end and the next begin."""
    lengths = [run.motor[run.judged].size for run in runs
               for _ in range(2 + bool(run.table_m.size) + (not closed))]
    return tuple(int(row) for row in np.cumsum(lengths)[:-1])


def in_parallel(jobs: Sequence[Callable[[], Result]]) -> list[Result]:
    """Measured fits side by side."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return [future.result() for future in [pool.submit(job) for job in jobs]]
