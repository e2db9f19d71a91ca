"""Refit that is not worse than the bench file, and the test whether a twin holds its closed loop.

A fit minimises the weighted sum over all channels, block by block. A channel may pay for another, and the closed loop
may become unstable. Then the point between the bench file and the fit is taken that is nearest to the fit and worse
than the bench file in no channel:

    x = x_bench + t (x_fit - x_bench),   t = 1, 1/2, 1/4, ..., 0
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.noise_floor import FLOOR, rms
from hil.twin.axis import Response

BLOCK, CLOSED = " (block by block)", " (in closed loop)"  # ends of the names of channels
Figures = Mapping[str, float]  # rms of each reported channel; infinite where the twin is unstable

_SHARES = (0.5, 0.25, 0.125, 0.0625)  # of the way to the fit, each half of the one before; less is no refit
# Change of the torque's residual from tick to tick over that of the torque from which a loop swings: masses wrong by
# the factor of three that is allowed make 2, velocity gains wrong by it and coarse counts 3.
_SWINGS = 5.0
SAME = 1.01  # growth of a rms that is none: rounding of the noise over some thousand rows


class Refit(NamedTuple):
    """A fit that is not worse than the bench file."""

    fit: Fit
    note: str = ""  # sentence on a fit that was shortened


def never_worse(fit: Fit, figures: Callable[[Hypothesis], Figures], enough: Figures) -> Refit:
    """Return the fit, or the point nearest to it at which no channel is worse than with the values of the bench file.

    `figures` gives the rms of each channel, `enough` the rms of a channel that is explained.
    """
    hypothesis = fit.hypothesis
    given = hypothesis.given
    before = figures(given)

    def worse(at: Hypothesis) -> tuple[str, ...]:
        after = figures(at)
        # "not less or equal" also holds for values that are not a number
        return tuple(
            name
            for name, value in before.items()
            if not after.get(name, math.inf) <= max(SAME * value, enough.get(name, 0.0))
        )

    full = worse(hypothesis)
    if not full:
        return Refit(fit)
    begin = given.x
    between = ((share, hypothesis.moved(begin + share * (hypothesis.x - begin))) for share in _SHARES)
    share, at = next(((share, point) for share, point in between if not worse(point)), (0.0, given))
    estimator = fit.estimator
    kept = f"{100.0 * share:g} % of its change was taken" if share else "the bench's values were kept"
    return Refit(
        replace(estimator.evaluate(at), jacobian=estimator.jacobian(at), converged=fit.converged),
        f"The refit without new physics would be worse than the bench file in {'; '.join(full)}: {kept}.",
    )


def rms_of_channels(hypothesis: Hypothesis, data: Dataset) -> dict[str, float]:
    """Residual rms of each channel over all runs, block by block and, with a control law, in closed loop."""
    bench = hypothesis.bench
    blocks = hypothesis.residuals(data).channels
    figures = {f"{name}{BLOCK}": _over_runs([part[name] for part in blocks], data) for name in _names(data)}
    if not data.observability.closed_loop:
        return figures
    if not holds(hypothesis, data):
        return figures | {f"{name}{CLOSED}": math.inf for name in _names(data)}
    closed, ratio = hypothesis.residuals(data, closed=True).channels, bench.axis.ratio_m_rad
    for name in _names(data):
        parts = [part[name] + ratio * part["motor"] if name == "table" else part[name] for part in closed]
        figures[f"{name}{CLOSED}"] = _over_runs(parts, data)
    return figures


def rms_at_floor(data: Dataset) -> dict[str, float]:
    """Residual rms of each channel up to which it is explained, by the names of `rms_of_channels`."""
    floors = {name: FLOOR**0.5 * _over_runs([scale[name] for scale in data.noise], data) for name in _names(data)}
    return {name + mode: level for name, level in floors.items() for mode in (BLOCK, CLOSED)}


def _names(data: Dataset) -> list[str]:
    run = data.runs[0]
    given = ("motor", "table", "torque") if run.table_m.size else ("motor", "torque")
    return [name for name in given if name not in run.observability.hidden]


def _over_runs(parts: Sequence[FloatArray], data: Dataset) -> float:
    with np.errstate(over="ignore"):  # the observer of a hypothesis may be unstable too
        return rms(np.concatenate([part[run.evaluated] for part, run in zip(parts, data.runs, strict=True)]))


def holds(hypothesis: Hypothesis, data: Dataset) -> bool:
    """True if the twin keeps to the recordings in closed loop, see `stays`."""
    left = hypothesis.residuals(data, closed=True).channels
    return all(stays(channels, run.response, run.evaluated) for channels, run in zip(left, data.runs, strict=True))


def stays(residuals: Mapping[str, FloatArray], measured: Response, evaluated: slice) -> bool:
    """True if a closed loop is stable: residuals (n,) of motor and torque stay within the range of their channel (rms).

    A torque limit bounds an unstable loop: then its torque swings from limit to limit. False also if the residual of
    the torque exceeds the torque's standard deviation and changes from tick to tick several times as much.
    """
    motor, torque = residuals["motor"][evaluated], residuals["torque"][evaluated]
    if not np.isfinite(motor).all() or not np.isfinite(torque).all():
        return False
    with np.errstate(over="ignore"):
        if rms(motor) > np.ptp(measured.motor_position[evaluated]) or rms(torque) > np.ptp(measured.torque[evaluated]):
            return False
    given = measured.torque[evaluated]
    return rms(torque) <= float(np.std(given)) or rms(np.diff(torque)) <= _SWINGS * rms(np.diff(given))


def unstable(run: Measured) -> str:
    """Sentence on a closed loop that the twin does not hold."""
    return (
        f"{run.name}: in closed loop the twin is unstable: it leaves the motion, or its torque swings. "
        "Figures are block by block, with measured inputs; check masses, gains, periods and delays of the bench."
    )
