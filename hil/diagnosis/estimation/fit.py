"""Prediction-error fit of a hypothesis (Ljung 1999, ch. 7) by the method of Levenberg and Marquardt.

    min over x of  sum rho(r(x)^2),   r: weighted residuals of all channels and runs

    step s:  min |J s + r|^2 + mu |diag(J) s|^2   with x + s inside the bounds;  mu after Nielsen (1999)

The Jacobian J is taken by differences, one simulation per parameter, on all cores: the kernel releases the
interpreter. While steps bring what they promise, J is not taken anew but corrected along the step (Broyden 1965; so
Madsen, Nielsen and Tingleff 2004, sec. 3.5); a fit that converges ends with a new one. A recording has 1e5 rows and a
hypothesis ten parameters, hence the step is found from J^T J: a decomposition of J, as scipy's solvers take it, costs
more than the simulations.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.optimize import lsq_linear

from hil.arrays import FloatArray
from hil.diagnosis.estimation.hypothesis import Model
from hil.identification.dataset import Measured

Result = TypeVar("Result")

POOL = ThreadPoolExecutor(os.cpu_count() or 1)

# Mean square of a channel over its noise, up to which it counts as explained: 25 % in rms, where something as large as
# the noise makes 41 %. An encoder at rest errs by the same part of a count all the time, which may be three times the
# mean square of counting.
FLOOR = 1.25**2
_FIRST_DAMPING = 1e-3
_LEAST_GAIN = 1e-6  # of the cost, relative: a step that promises or brings less is the last
_AGREES = 0.25  # by which a step may miss what it promised, relative, while the Jacobian is still good


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

    @property
    def parts(self) -> list[FloatArray]:
        """Weighted residuals of each channel of each run."""
        return np.split(self.residuals, self.splits)

    @property
    def at_floor(self) -> bool:
        """Whether every channel of every run is down to its noise."""
        return all(float(part @ part) <= FLOOR * part.size for part in self.parts)


def evaluate(model: Model, runs: Sequence[Measured], x: FloatArray | None = None) -> Fit:
    """A hypothesis as it stands at `x` or its own start, not fitted: its Jacobian is empty."""
    at = model.initial() if x is None else x
    residuals = model.residuals(at, runs)
    return Fit(model, at, residuals, np.zeros((residuals.size, 0)), splits(model, runs))


def jacobian(
    model: Model,
    x: FloatArray,
    base: FloatArray,
    runs: Sequence[Measured],
    *,
    closed: bool = False,
    held: FloatArray | None = None,
) -> FloatArray:
    """Derivative of the weighted residuals (m, parameters) by forward differences, columns in parallel.

    The first columns are those `held` (m, k), where given.
    """
    _, high = model.bounds()
    known = 0 if held is None else held.shape[1]
    slopes = np.empty((base.size, x.size), order="F")
    if held is not None:
        slopes[:, :known] = held

    def column(index: int) -> None:
        step = model.coordinates[index].step
        if x[index] + step > high[index]:
            step = -step
        moved = x.copy()
        moved[index] += step
        slopes[:, index] = (model.residuals(moved, runs, closed) - base) / step

    list(POOL.map(column, range(known, x.size)))
    return slopes


def fit(
    model: Model,
    runs: Sequence[Measured],
    x: FloatArray | None = None,
    *,
    soft: float = 0.0,
    evaluations: int = 30,
    closed: bool = False,
    held: FloatArray | None = None,
    slopes: FloatArray | None = None,
) -> Fit:
    """Fit all coordinates of a model, from `x` or the model's own start.

    `soft` > 0 is the size of residual from which the loss grows only linearly. `closed` takes the residuals of
    the closed loop instead of those of the blocks. `held` (m, k) are derivatives by the first k coordinates that
    are taken as constant on the way: near a point where they are known, that saves most simulations. `slopes`
    (m, parameters) are derivatives to start with, from somewhere near.
    """
    low, high = model.bounds()
    at = np.clip(model.initial() if x is None else x, low, high)
    residuals = model.residuals(at, runs, closed)
    fresh = slopes is None
    if slopes is None:
        slopes = jacobian(model, at, residuals, runs, closed=closed, held=held)
    damping, growth = _FIRST_DAMPING, 2.0
    size = np.zeros(at.size)
    used = 1
    while used < evaluations:
        loss, weights = _loss(residuals, soft)
        weighted = slopes if weights is None else slopes * weights[:, None]
        normal = weighted.T @ weighted
        descent = weighted.T @ (residuals if weights is None else residuals * weights)
        size = np.maximum(size, np.sqrt(np.diag(normal)))
        step = _step(normal, descent, damping, size, low - at, high - at)
        promised = -float(step @ (2.0 * descent + normal @ step))
        if promised <= _LEAST_GAIN * loss:
            if fresh:
                break
            slopes, fresh = jacobian(model, at, residuals, runs, closed=closed), True
            continue
        moved = model.residuals(at + step, runs, closed)
        used += 1
        gained = loss - _loss(moved, soft)[0]
        if gained > 0.0:
            fresh = held is not None or abs(gained / promised - 1.0) > _AGREES
            slopes = slopes if fresh else _corrected(slopes, moved - residuals, step, size)
            at, residuals = at + step, moved
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gained / promised - 1.0) ** 3)
            growth = 2.0
        else:
            damping *= growth
            growth *= 2.0
        if fresh == (gained > 0.0):  # a step that failed asks for no other derivatives, if these are new
            slopes, fresh = jacobian(model, at, residuals, runs, closed=closed, held=held), True
            if 0.0 < gained <= _LEAST_GAIN * loss:
                break
    return Fit(model, at, residuals, slopes, splits(model, runs, closed))


def _corrected(slopes: FloatArray, change: FloatArray, step: FloatArray, size: FloatArray) -> FloatArray:
    """The Jacobian that agrees with the change (m,) over a step, otherwise as it was; parameters weigh by `size`."""
    along = size**2 * step
    return np.asarray(slopes + np.outer((change - slopes @ step) / float(step @ along), along), dtype=np.float64)


def soft_cost(residuals: FloatArray, soft: float) -> float:
    """Sum of rho of the rows."""
    return _loss(residuals, soft)[0]


def _loss(residuals: FloatArray, soft: float) -> tuple[float, FloatArray | None]:
    """Sum of rho, and the weights sqrt(rho') of the rows; rho(z) = 2 soft^2 (sqrt(1 + z / soft^2) - 1)."""
    if not soft:
        return float(residuals @ residuals), None
    root = np.sqrt(1.0 + (residuals / soft) ** 2)
    return float(2.0 * soft**2 * np.sum(root - 1.0)), np.asarray(1.0 / np.sqrt(root), dtype=np.float64)


def _step(
    normal: FloatArray, descent: FloatArray, damping: float, size: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """The damped step of the module's equation, between `low` and `high`."""
    scale = np.where(size > 0.0, size, 1.0)
    damped = normal / np.outer(scale, scale) + damping * np.eye(scale.size)
    values, vectors = np.linalg.eigh(damped)
    root = vectors * np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    target = np.linalg.solve(root, -descent / scale)
    free = np.linalg.solve(root.T, target)
    if np.all(free > low * scale) and np.all(free < high * scale):
        return np.asarray(free / scale, dtype=np.float64)
    wide = np.maximum(high - low, 1e-12)
    found = lsq_linear(
        root.T,
        target,
        (np.minimum(low, 0.0) * scale - 1e-12 * wide * scale, np.maximum(high, 0.0) * scale + 1e-12 * wide * scale),
        method="bvls",
    )
    return np.asarray(np.clip(found.x / scale, low, high), dtype=np.float64)


def splits(model: Model, runs: Sequence[Measured], closed: bool = False) -> tuple[int, ...]:
    """Where the residuals of one channel of one run end and the next begin."""
    lengths = [run.motor[run.judged].size for run in runs for _ in range(2 + bool(run.table_m.size) + (not closed))]
    return tuple(int(row) for row in np.cumsum(lengths)[:-1])


def in_parallel(jobs: Sequence[Callable[[], Result]]) -> list[Result]:
    """Results of jobs that run side by side, in order."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return [future.result() for future in [pool.submit(job) for job in jobs]]
