"""Refit that is not worse than the bench file, and the test whether a twin holds its closed loop.

A fit minimises the weighted sum over all channels, block by block. A channel may pay for another, and the closed loop
may become unstable. Then the point between the bench file and the fit is taken that is nearest to the fit and worse
than the bench file in no channel:

    x = x_bench + t (x_fit - x_bench),   t = 1, 1/2, 1/4, ..., 0
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.twin.axis import Response

Figures = Mapping[str, float]  # rms of each reported channel; infinite where the twin is unstable

_SHARES = (0.5, 0.25, 0.125, 0.0625)  # of the way to the fit, each half of the one before; less is no refit
SAME = 1.01  # growth of a rms that is none: rounding of the noise over some thousand rows


def never_worse(fit: Fit, figures: Callable[[Hypothesis], Figures], enough: Figures) -> Fit:
    """Return the fit, or the point nearest to it at which no channel is worse than with the values of the bench file.

    `figures` gives the rms of each channel, `enough` the rms of a channel that is explained. A fit that was moved is
    not converged.
    """
    hypothesis = fit.hypothesis
    before = figures(hypothesis.owner)

    def worse(at: Hypothesis) -> bool:
        found = figures(at)
        # "not less or equal" also holds for values that are not a number
        return any(not found[name] <= max(SAME * before[name], enough.get(name, 0.0)) for name in before)

    if not worse(hypothesis):
        return fit
    begin = hypothesis.owner.x
    between = (hypothesis.moved(begin + share * (hypothesis.x - begin)) for share in _SHARES)
    at = next((point for point in between if not worse(point)), hypothesis.owner)
    estimator = fit.estimator
    return replace(estimator.evaluate(at), jacobian=estimator.jacobian(at), converged=False)


def holds(hypothesis: Hypothesis, data: Dataset) -> bool:
    """True if the twin keeps to the recordings in closed loop: each channel deviates by less than it moves (rms)."""
    left = hypothesis.residuals(data, closed=True).channels
    return all(stays(channels, run.response, run.judged) for channels, run in zip(left, data.runs, strict=True))


def stays(residuals: Mapping[str, FloatArray], measured: Response, judged: slice) -> bool:
    """True if the residuals (n,) of motor and torque are finite and below the range of their channel (rms)."""
    for values, channel in ((residuals["motor"], measured.motor_position), (residuals["torque"], measured.torque)):
        with np.errstate(over="ignore", invalid="ignore"):
            size = float(np.sqrt(np.mean(values[judged] ** 2)))
        if not size <= float(np.ptp(channel[judged])):
            return False
    return True


def unstable(run: Measured) -> str:
    """Sentence on a closed loop that the twin does not hold."""
    return (
        f"{run.name}: in closed loop the twin is unstable: it deviates by more than the whole motion or torque. "
        "Figures are block by block, with measured inputs; check masses, gains, periods and delays of the bench."
    )
