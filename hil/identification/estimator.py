"""Prediction-error fit of a hypothesis (Ljung 1999, ch. 7) by the Levenberg-Marquardt method.

    min over x of  sum rho(r(x)^2),   r: weighted residuals of all channels and runs

    step s:  min |J s + r|^2 + mu |diag(J) s|^2   with x + s inside the bounds;  mu after Nielsen (1999)

The Jacobian J is computed by forward differences, one simulation per parameter, on all cores. While steps gain what the
linear model predicts, J is updated along the step instead (Broyden 1965; Madsen, Nielsen and Tingleff 2004, sec. 3.5);
a converged fit ends with a new J. The step is computed from J^T J: with 1e5 rows and ten parameters a decomposition of
J, as in scipy's solvers, takes longer than the simulations.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from hil.arrays import FloatArray, SingleArray
from hil.bench.bench_file import Bench
from hil.identification.coordinates import EDGE_STEP_S
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.levenberg_marquardt import broyden, damped_step, normal_equations, robust_loss
from hil.identification.noise_floor import COLOURED, FLOOR, noise_ratios
from hil.identification.parallel import POOL
from hil.identification.residual_scales import TORQUE_ACCURACY, inertia
from hil.identification.residuals import Residuals, noise_there
from hil.identification.terms import Term

_FIRST_DAMPING = 1e-3  # relative to diag(J)^2: for a moderately good start (Madsen, Nielsen and Tingleff 2004)
_LEAST_GAIN = 1e-6  # relative to the cost: a step that predicts or gains less ends the fit; far below any evidence
_AGREES = 0.25  # largest relative error of the predicted gain at which the Jacobian is updated, not recomputed


class FitStatus(StrEnum):
    """Ending of a fit."""

    NOT_FITTED = "not_fitted"
    CONVERGED = "converged"
    OUT_OF_STEPS = "out_of_steps"
    PARAMETER_AT_BOUND = "parameter_at_bound"


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis with its weighted residuals and their Jacobian (m, p); (m, 0) if it was not fitted."""

    hypothesis: Hypothesis
    residuals: Residuals
    jacobian: FloatArray
    estimator: "Estimator"
    converged: bool | None = None  # None if it was not fitted
    _elsewhere: dict[Dataset, "Fit"] = field(default_factory=dict, init=False, repr=False)

    @property
    def data(self) -> Dataset:
        """Data set of the fit."""
        return self.estimator.data

    @property
    def bench(self) -> Bench:
        """Bench with the fitted nominal parameters."""
        return self.hypothesis.resolved.bench

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms with their fitted values."""
        return self.hypothesis.resolved.terms

    @cached_property
    def cost(self) -> float:
        """Sum of squared weighted residuals."""
        return float(self.residuals.vector @ self.residuals.vector)

    @property
    def rows(self) -> int:
        """Number of weighted residuals."""
        return self.residuals.vector.size

    @cached_property
    def noise_energy(self) -> float:
        """Energy of the noise in all residuals, in units of noise^2."""
        return sum(noise_there(part) for part in self.residuals.parts.values())

    @property
    def reduced(self) -> float:
        """Mean squared weighted residual."""
        return self.cost / self.rows

    @cached_property
    def noise_ratios(self) -> tuple[dict[str, float], ...]:
        """Mean square over noise of each channel, for each run."""
        return noise_ratios(self.hypothesis, self.data)

    @property
    def worst_ratio(self) -> float:
        """Largest mean square over noise of all channels and runs."""
        return max(ratio for ratios in self.noise_ratios for ratio in ratios.values())

    @property
    def within_noise(self) -> bool:
        """True where the noise of a torque, white or coloured, drives the twin: only shapes of terms are evidence."""
        return self.worst_ratio <= COLOURED and not self.data.observability.exact_input

    @property
    def at_floor(self) -> bool:
        """True if every channel of every run is at its noise floor."""
        return self.worst_ratio <= FLOOR

    @property
    def excess(self) -> float:
        """Energy above the noise floor in units of noise^2."""
        return sum(self.excess_by_channel.values())

    @cached_property
    def excess_by_channel(self) -> dict[str, float]:
        """Energy of each channel above the noise floor in units of noise^2."""
        return self.energy(lambda ratio: max(ratio - 1.0, 0.0))

    def energy(self, of: Callable[[float], float]) -> dict[str, float]:
        """Sum of a function of the noise ratios over all evaluated rows, by channel."""
        found = dict[str, float]()
        for run, ratios in zip(self.data.runs, self.noise_ratios, strict=True):
            for channel, ratio in ratios.items():
                found[channel] = found.get(channel, 0.0) + run.motor[run.evaluated].size * of(ratio)
        return found

    @cached_property
    def missed_torque(self) -> float:
        """Sum of squared weighted residuals of the motor, as a torque: times the squared inertia.

        A torque that the twin misses moves a heavier axis less: the residuals of the motor alone may fall for a wrong
        inertia.
        """
        parts = (part for (_, channel), part in self.residuals.parts.items() if channel == "motor")
        return inertia(self.bench) ** 2 * sum(float(part @ part) for part in parts)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of the parameters that ended at a bound; friction that is 0, as the bench has it, is at none."""
        low, high = self.hypothesis.bounds
        x, coordinates = self.hypothesis.x, self.hypothesis.coordinates
        return tuple(
            one.name
            for one, value, a, b in zip(coordinates, x, low, high, strict=True)
            if (value <= a and not one.left_out) or value >= b
        )

    @property
    def status(self) -> FitStatus:
        """How the fit ended."""
        if not self.converged:
            return FitStatus.NOT_FITTED if self.converged is None else FitStatus.OUT_OF_STEPS
        return FitStatus.PARAMETER_AT_BOUND if self.at_bound else FitStatus.CONVERGED

    def on(self, data: Dataset) -> "Fit":
        """Evaluate the hypothesis on a data set; on its own data set this is the fit itself."""
        if data is not self.data and data not in self._elsewhere:
            self._elsewhere[data] = replace(self.estimator, data=data).evaluate(self.hypothesis)
        return self if data is self.data else self._elsewhere[data]

    def without_deadline(self) -> "Fit":
        """The same fit, whose refits are not limited in time."""
        return replace(self, estimator=replace(self.estimator, deadline_s=math.inf))

    def with_accuracy(self, torque_accuracy: float) -> "Fit":
        """Evaluate the hypothesis, not fitted, with another weight of the motor channel and the twin's own steps."""
        return replace(self.estimator, torque_accuracy=torque_accuracy, fast=False).evaluate(self.hypothesis)

    def refit(
        self, evaluations: int, *, soft: float = 0.0, slopes: FloatArray | None = None, fixed: Sequence[int] = ()
    ) -> "Fit":
        """Continue the fit with the same settings."""
        return self.estimator.fit(self.hypothesis, evaluations=evaluations, soft=soft, slopes=slopes, fixed=fixed)


@dataclass(frozen=True, eq=False)
class Estimator:
    """Fits hypotheses to a data set.

    `edge_step_s` is the forward-difference step for the edge of a window, `torque_accuracy` the torque resolved by the
    motor channel over the noise of the torque channel. `closed` selects residuals in closed loop, `fast` those with the
    internal steps of a search. After `deadline_s` of processor time (`time.process_time`) fits take no more steps.
    """

    data: Dataset
    edge_step_s: float = EDGE_STEP_S
    torque_accuracy: float = TORQUE_ACCURACY
    closed: bool = False
    fast: bool = False
    deadline_s: float = math.inf

    @property
    def expired(self) -> bool:
        """True after the deadline."""
        return time.process_time() > self.deadline_s

    def residuals(self, hypothesis: Hypothesis) -> Residuals:
        """Residuals of a hypothesis, weighted by these settings."""
        return hypothesis.residuals(self.data, self.closed, self.fast).weighted_by(self.torque_accuracy)

    def evaluate(self, hypothesis: Hypothesis) -> Fit:
        """Evaluate a hypothesis without fitting it."""
        residuals = self.residuals(hypothesis)
        return Fit(hypothesis, residuals, np.zeros((residuals.vector.size, 0)), self)

    def steps(self, hypothesis: Hypothesis) -> FloatArray:
        """Steps (p,) of the forward differences."""
        return hypothesis.steps(self.data.travel_m, self.data.duration_s, self.edge_step_s)

    def jacobian(self, hypothesis: Hypothesis, held: FloatArray | SingleArray | None = None) -> FloatArray:
        """Derivative of the weighted residuals (m, p) by forward differences, columns in parallel.

        The first columns are `held` (m, k) if given.
        """
        base, x = self.residuals(hypothesis).vector, hypothesis.x
        steps, high = self.steps(hypothesis), hypothesis.bounds[1]
        known = 0 if held is None else held.shape[1]
        slopes = np.empty((base.size, x.size), order="F")
        if held is not None:
            slopes[:, :known] = held

        def column(index: int) -> None:
            step = -steps[index] if x[index] + steps[index] > high[index] else steps[index]
            moved = x.copy()
            moved[index] += step
            slopes[:, index] = (self.residuals(hypothesis.moved(moved)).vector - base) / step

        list(POOL.map(column, range(known, x.size)))
        return slopes

    def fit(
        self,
        hypothesis: Hypothesis,
        *,
        soft: float = 0.0,
        evaluations: int = 30,
        held: FloatArray | SingleArray | None = None,
        slopes: FloatArray | SingleArray | None = None,
        fixed: Sequence[int] = (),
    ) -> Fit:
        """Fit all parameters of a hypothesis from its x with at most so many `evaluations`.

        `soft` > 0 is the residual above which the loss is linear. `held` (m, k) are derivatives by the first k
        parameters that are kept constant, which saves simulations. `slopes` (m, p) is a first Jacobian from nearby,
        none if it is empty. The entries `fixed` of x keep their values.
        """
        low, high = hypothesis.bounds
        for index in fixed:
            low[index] = high[index] = hypothesis.x[index]
        inside = np.clip(hypothesis.x, low, high)
        at = hypothesis if np.array_equal(inside, hypothesis.x) else hypothesis.moved(inside)
        residuals = self.residuals(at)
        fresh = slopes is None or not slopes.size
        slopes = self.jacobian(at, held) if slopes is None or fresh else slopes.astype(np.float64, order="F")
        damping, growth = _FIRST_DAMPING, 2.0
        size = np.zeros(at.x.size)
        used, converged = 1, False
        while used < evaluations and not self.expired:
            loss, weights = robust_loss(residuals.vector, soft) if soft else residuals.likelihood_loss
            normal, descent = normal_equations(slopes, residuals.vector, weights)
            size = np.maximum(size, np.sqrt(np.diag(normal)))
            step = damped_step(normal, descent, damping, size, low - at.x, high - at.x)
            promised = -float(step @ (2.0 * descent + normal @ step))
            if promised <= _LEAST_GAIN * loss:
                if fresh:
                    converged = True
                    break
                del slopes
                slopes, fresh = self.jacobian(at), True
                continue
            moved = at.moved(at.x + step)
            there = self.residuals(moved)
            used += 1
            gained = loss - (robust_loss(there.vector, soft) if soft else there.likelihood_loss)[0]
            if gained > 0.0:
                fresh = held is not None or abs(gained / promised - 1.0) > _AGREES
                if not fresh:
                    broyden(slopes, there.vector - residuals.vector, step, size)
                at, residuals = moved, there
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * gained / promised - 1.0) ** 3)
                growth = 2.0
            else:
                damping *= growth
                growth *= 2.0
            if fresh == (gained > 0.0):  # after a failed step with a new Jacobian only the damping changes
                del slopes
                slopes, fresh = self.jacobian(at, held), True
                if 0.0 < gained <= _LEAST_GAIN * loss:
                    converged = True
                    break
        return Fit(at, residuals, slopes, self, converged)
