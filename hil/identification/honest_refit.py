"""Refit that is not worse than the bench file, and the test whether a twin holds its closed loop.

A fit minimises the weighted sum over all channels, block by block. A channel may pay for another, and the closed loop
may become unstable. Then the point between the bench file and the fit is taken that is nearest to the fit and worse
than the bench file in no channel:

    x = x_bench + t (x_fit - x_bench),   t = 1, 1/2, 1/4, ..., 0
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.noise_floor import FLOOR, rms
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
        return any(not found.get(name, math.inf) <= max(SAME * before[name], enough.get(name, 0.0)) for name in before)

    if not worse(hypothesis):
        return fit
    begin = hypothesis.owner.x
    between = (hypothesis.moved(begin + share * (hypothesis.x - begin)) for share in _SHARES)
    at = next((point for point in between if not worse(point)), hypothesis.owner)
    estimator = fit.estimator
    return replace(estimator.evaluate(at), jacobian=estimator.jacobian(at), converged=False)


def rms_of_channels(hypothesis: Hypothesis, data: Dataset) -> dict[str, float]:
    """Residual rms of each channel over all runs, block by block and, with a control law, in closed loop."""
    bench = hypothesis.bench
    blocks = hypothesis.residuals(data).channels
    found = {f"{name}, block": _over_runs([part[name] for part in blocks], data) for name in _names(data)}
    if not bench.law_known:
        return found
    if not holds(hypothesis, data):
        return found | {f"{name}, closed loop": math.inf for name in _names(data)}
    closed, ratio = hypothesis.residuals(data, closed=True).channels, bench.axis.ratio_m_rad
    for name in _names(data):
        parts = [part[name] + ratio * part["motor"] if name == "table" else part[name] for part in closed]
        found[f"{name}, closed loop"] = _over_runs(parts, data)
    return found


def rms_at_floor(data: Dataset) -> dict[str, float]:
    """Residual rms of each channel up to which it is explained, by the names of `rms_of_channels`."""
    found = {name: FLOOR**0.5 * _over_runs([scale[name] for scale in data.noise], data) for name in _names(data)}
    return {f"{name}, {mode}": level for name, level in found.items() for mode in ("block", "closed loop")}


def _names(data: Dataset) -> list[str]:
    run = data.runs[0]
    given = ("motor", "table", "torque") if run.table_m.size else ("motor", "torque")
    return [name for name in given if name not in run.unseen]


def _over_runs(parts: Sequence[FloatArray], data: Dataset) -> float:
    with np.errstate(over="ignore"):  # the observer of a hypothesis may be unstable too
        return rms(np.concatenate([part[run.judged] for part, run in zip(parts, data.runs, strict=True)]))


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
