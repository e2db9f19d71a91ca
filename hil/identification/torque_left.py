"""Torque that a model of the axis leaves, predicted from the measured motion, as a share of the torque's deviation.

    left = rms(T - T_model) / std(T)      over the rows about which the axis slides one way, up to some 20 Hz

The residual is that of held-out motion, the deviation that of all recordings: a held-out part that is one slow end
needs hardly any torque of its own.

The twin is held on the measured motion by its observer and fed the measured torque. Its innovation e tells the torque
that its mechanics lack. The scale is that of the twin itself: its innovation is computed a second time, with a torque
added along the motion. Nothing is simulated in closed loop, where a controller hides what a model lacks.

The plain model is that of `hil.identification.plain_model`, fitted to the training recordings: [a, v, sign(v), 1] on
the rows that slide. Its residual passes the same filter as the innovation, so that both are compared in one band;
between stretches that slide, where the sign of the velocity is not known, it goes on from one to the next:

    e(z) = a^2 z^-1 / (1 - (2 - 2 a - a^2) z^-1 + (1 - 2 a) z^-2),   a = T / tau      of a rigid axis
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.derivatives import matched, noise_gains
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.measured import Measured
from hil.identification.plain_model import MotionData, PlainModel, SlowestSliding, fit_plain_model
from hil.identification.structure import ResidualSeries
from hil.identification.twin_deviation import held_on_motor
from hil.twin.axis import Steps

_ADDED = 0.01  # of the torque's standard deviation: far above rounding, and an axis that slides goes on sliding
# Some rows that slide by the measured motion may not by that of a twin: quantile of the others; share of them that is
# nothing; rounds in which they get more torque, each twice that of the one before, at first the noise.
_SLIDE, _FEW, _AGAIN = 0.9, 0.01, 6


@lru_cache(maxsize=8)
def fit_plain(data: Dataset) -> PlainModel | None:
    """Fit the plain model to a data set; None without sliding motion."""
    axis = data.bench.axis
    return fit_plain_model([measured_motion(run) for run in data.runs], axis.ratio_m_rad if axis.turns else None)


def torque_deviation(every: Sequence[Dataset], slowest: SlowestSliding) -> float:
    """Standard deviation of the torque of data sets where the motor is faster than `slowest`; 0 where nothing is."""
    found = [measured_motion(run) for data in every for run in data.runs]
    torque = np.concatenate([one.torque[one.sliding(slowest)] for one in found])
    return float(np.std(torque)) if torque.size else 0.0


def torque_missed(fit: Fit, data: Dataset) -> float | None:
    """Torque that the motion of a data set needs beyond that of a twin, over the deviation of all recordings (rms).

    None where nothing slides, infinite where the twin does not hold the motion.
    """
    if (found := _missed(fit, data)) is None:
        return None
    missed, slowest = found
    return missed / torque_deviation([fit.data, data], slowest)


def missed_beyond_noise(fit: Fit, data: Dataset) -> float:
    """`torque_missed` less the white noise; 0: not known."""
    missed, slowest = _missed(fit, data) or (math.inf, None)
    if slowest is None or not math.isfinite(missed):
        return 0.0
    gains = [noise_gains(run.period_s, measured_motion(run).window)[0] * run.noise.torque for run in data.runs]
    beyond = missed**2 - float(np.mean(np.square(gains)))
    return math.sqrt(max(beyond, 0.0)) / torque_deviation([fit.data, data], slowest)


def _missed(fit: Fit, data: Dataset) -> tuple[float, SlowestSliding] | None:
    """Torque that the motion of a data set needs beyond that of a twin (rms), where an axis slides; see above."""
    plain = fit_plain(fit.data) if data.runs and data.observability.torque_measured else None
    if plain is None or not torque_deviation([data], plain.slowest):
        return None
    missed = left_by_twin(fit.hypothesis, data, plain, 1.0)
    return math.inf if missed is None else missed, plain.slowest


def mismatch_left(before: Fit, after: Fit, data: Dataset, noise: Collection[str] = ()) -> float:
    """Share of the energy above the floor of a fit on a data set that another leaves, in [0, 1].

    The position of the motor counts slow motion and bursts more than all other motion. Where the torque that it needs
    beyond the twin's falls more, that is its share. What is left of the channels `noise` does not count.
    """
    was, left = (dict(fit.on(data).excess_by_channel) for fit in (before, after))
    missed, missing = torque_missed(before, data), torque_missed(after, data)
    if missed and missing is not None and math.isfinite(missed):
        left["motor"] = min(left["motor"], was["motor"] * (missing / missed) ** 2)
    total, rest = sum(was.values()), sum(value for name, value in left.items() if name not in noise)
    return min(rest / total, 1.0) if total > 0.0 else float(rest > 0.0)


def left_by_plain(model: PlainModel, data: Dataset, deviation: float | None = None) -> float | None:
    """Share of the torque's standard `deviation` that the plain model leaves on a data set; None where nothing slides.

    Without a deviation it is that of the data set.
    """
    found = []
    for run in data.runs:
        motion = measured_motion(run)
        rows, a = np.flatnonzero(motion.sliding(model.slowest)), run.period_s / data.observer_s
        missing = (motion.torque - model.predict(motion.moved))[rows]
        if rows.size:
            found.append(observed(np.interp(np.arange(run.motor.size), rows, missing), a)[rows])
    return _share(found, data, model.slowest, deviation)


@lru_cache(maxsize=16)
def left_by_twin(
    hypothesis: Hypothesis, data: Dataset, plain: PlainModel, deviation: float | None = None
) -> float | None:
    """Share of the torque's standard `deviation` that a twin leaves where the axis slides; None where nothing does.

    Without a deviation it is that of the data set.
    """
    found = zip(needed_torque(hypothesis, data, plain), data.runs, strict=True)
    left = [matched(series.left, measured_motion(run).window)[series.rows] for series, run in found]
    return _share(left, data, plain.slowest, deviation)


def needed_torque(hypothesis: Hypothesis, data: Dataset, plain: PlainModel, fast: bool = False) -> list[ResidualSeries]:
    """Torque (n,) that the measured motion of each run needs beyond that of a twin; NaN where it does not hold it.

    Rows in which the axis slides count. `fast`: with the internal steps of a search.
    """
    found = []
    for run in data.runs:
        motion = measured_motion(run)
        rows = motion.sliding(plain.slowest)
        innovation_with = partial(_innovation, hypothesis, run, data.observer_s, data.steps_of(fast))
        lacking, sticks = _lacking(innovation_with, run, motion, rows, run.period_s / data.observer_s)
        found.append(ResidualSeries(-lacking, rows, sticks))
    return found


def _lacking(
    innovation_with: Callable[[FloatArray], FloatArray],
    run: Measured,
    motion: MotionData,
    rows: NDArray[np.bool_],
    a: float,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Torque (n,) that a twin lacks to make the motion of a run in the rows (n,), and rows in which it sticks still.

    The torque is NaN where none moves the twin; `a` is the period over the time constant of the observer.

    The innovation of a twin that slides tells it. Where a torque less by its noise stops one that creeps, it gets more,
    which counts as lacking, as long as fewer rows stick then.
    """
    way, deviation = motion.moved.direction, float(np.std(run.torque))
    more, added, noise = np.zeros(run.motor.size), _ADDED * deviation * way, run.noise.torque
    found, stuck, before = np.full(run.motor.size, np.nan), rows, np.count_nonzero(rows) + 1
    for _ in range(_AGAIN):
        innovation = innovation_with(more)
        moved = (innovation - innovation_with(more + added)) * way
        scale = float(np.quantile(moved[rows], _SLIDE)) if rows.any() else 0.0
        sticks = rows & (moved < 0.5 * scale)
        if not scale > 0.0 or np.count_nonzero(sticks) >= before:
            break
        found, stuck = innovation * _ADDED * deviation / scale + observed(more, a), sticks
        before = np.count_nonzero(sticks)
        if before <= _FEW * np.count_nonzero(rows):
            break
        more = np.where(maximum_filter1d(sticks, motion.window), more + noise * way, more)
        noise *= 2.0
    return np.asarray(found, dtype=np.float64), stuck


def observed(torque: FloatArray, a: float) -> FloatArray:
    """A torque (n,) behind the filter of the innovation."""
    seen = lfilter([0.0, a * a], [1.0, -(2.0 - 2.0 * a - a * a), 1.0 - 2.0 * a], torque)
    return np.asarray(seen, dtype=np.float64)


def quiet_motion(data: Dataset) -> Dataset:
    """The recordings with the smoothed motion of their encoders."""
    return data.over(tuple(replace(run, motor=measured_motion(run).moved.position) for run in data.runs))


def lacking_torque(hypothesis: Hypothesis, data: Dataset) -> list[FloatArray]:
    """Torque (n,) that moves the motor of each run beyond a twin, on smoothed motion and in the whole band.

    The filter of the innovation is undone, which would make the noise of an encoder large. None where nothing slides.
    """
    plain = fit_plain(data)
    if plain is None:
        return []
    still, found = quiet_motion(data), []
    for run, series in zip(still.runs, needed_torque(hypothesis, still, plain, fast=True), strict=True):
        a, seen = run.period_s / data.observer_s, -np.nan_to_num(series.left)
        later, before = np.append(seen[1:], seen[-1:]), np.append(seen[:1], seen[:-1])
        found.append((later - (2.0 - 2.0 * a - a * a) * seen + (1.0 - 2.0 * a) * before) / (a * a))
    return found


def _innovation(hypothesis: Hypothesis, run: Measured, observer_s: float, steps: Steps, more: FloatArray) -> FloatArray:
    """Measured less simulated motor position (n,) of a twin held on it, with more torque (n,) than the measured one."""
    measured, held = held_on_motor(hypothesis, run, observer_s, steps, more)
    return np.asarray(measured.motor_position - held.motor_position, dtype=np.float64)


def _share(
    missing: Sequence[FloatArray], data: Dataset, slowest: SlowestSliding, deviation: float | None
) -> float | None:
    left = np.concatenate([*missing, np.zeros(0)])
    if not np.isfinite(left).all():  # the twin does not hold the motion
        return None
    deviation = torque_deviation([data], slowest) if deviation is None else deviation
    return float(np.sqrt(np.mean(left**2)) / deviation) if left.size and deviation > 0.0 else None
