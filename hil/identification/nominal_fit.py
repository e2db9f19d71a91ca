"""Fit the nominal parameters of an axis to recordings, block by block: the first step of every diagnosis."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from hil.bench.bench_file import Bench
from hil.errors import HilError
from hil.identification.coordinates import DELAY
from hil.identification.dataset import Dataset
from hil.identification.estimator import Estimator, Fit, FitStatus
from hil.identification.honest_refit import Figures, never_worse, rms_at_floor, rms_of_channels
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.parallel import one_blas_thread

SOFT = 30.0  # residual [noise] above which the loss of a first fit is linear: outliers do not dominate the first steps
MOST_STEPS = 50  # evaluations of a fit to convergence; a fit that needs more is reported as not converged
_FIRST, _SECOND = 8, 10  # evaluations: a search needs a nearly converged fit only


@dataclass(frozen=True)
class FittedParameter:
    """A parameter of the axis, SI unit in its name."""

    name: str
    nominal: float
    value: float
    standard_error: float
    at_bound: bool = False  # of the allowed range: not identifiable from this motion


@dataclass(frozen=True)
class FitResult:
    """The bench with fitted parameters, and how the fit ended."""

    bench: Bench
    parameters: tuple[FittedParameter, ...]
    status: FitStatus
    note: str = ""  # on a fit that was shortened because it would be worse than the bench file

    @property
    def converged(self) -> bool:
        """False if the fit ran out of steps: the parameters are the best so far."""
        return self.status is not FitStatus.OUT_OF_STEPS


@one_blas_thread
def fit_nominal_parameters(data: Dataset, evaluations: int = _SECOND, deadline_s: float = math.inf) -> Fit:
    """Fit the nominal parameters alone, first with a robust loss; fits from it have the same deadline.

    If the fit misses more torque than the bench file, or a mass ended at a bound, it is repeated with the masses of the
    bench file, and the fit that misses less torque is taken.
    """
    estimator, begin = Estimator(data, deadline_s=deadline_s), Hypothesis(data.bench)
    fit = estimator.fit(begin, soft=SOFT, evaluations=_FIRST).refit(evaluations)
    masses = [index for index, name in enumerate(begin.nominal) if name in data.bench.axis.MASSES]
    stuck = set(fit.at_bound) & set(data.bench.axis.MASSES)
    if not stuck and fit.missed_torque <= estimator.evaluate(begin).missed_torque:
        return fit
    kept = estimator.fit(begin, soft=SOFT, evaluations=_FIRST, fixed=masses).refit(evaluations, fixed=masses)
    return min(fit, kept, key=lambda fit: fit.missed_torque)


def require_finite(fit: Fit) -> None:
    """Raise HilError if residuals of a fit are not finite: the twin, or its observer, is unstable."""
    if not all(np.isfinite(values).all() for channels in fit.residuals.channels for values in channels.values()):
        raise HilError(
            f"the fit of {', '.join(fit.bench.axis.refitted)} has no finite result: the twin of this axis is unstable "
            f"at a period of {fit.data.runs[0].period_s:g} s; check masses, stiffness, units and signs, or give a "
            "recording with more motion"
        )


def fit_nominal(data: Dataset, figures: Callable[[Hypothesis], Figures] | None = None) -> FitResult:
    """Fit the nominal parameters of a bench to convergence, within a factor of three of the bench file.

    `figures` are those in which the fit must not be worse than the bench file, by default the rms of each channel, see
    `honest_refit`. Raises HilError if the residuals are not finite.
    """
    fit = fit_nominal_parameters(data, MOST_STEPS)
    require_finite(fit)
    refit = never_worse(fit, figures or partial(rms_of_channels, data=data), rms_at_floor(data))
    fit = refit.fit
    hypothesis = fit.hypothesis
    entries = zip(hypothesis.nominal, hypothesis.bench_values, hypothesis.values, standard_errors(fit), strict=False)
    parameters = tuple(
        FittedParameter(name, before, value, error, name in fit.at_bound)
        for name, before, value, error in entries
        if name != DELAY
    )
    return FitResult(fit.bench, parameters, fit.status, refit.note)
