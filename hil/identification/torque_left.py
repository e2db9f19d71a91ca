"""Torque that a model of the axis leaves, predicted from the measured motion, as a share of the torque's deviation.

    left = rms(T - T_model) / std(T)      over the rows in which the axis slides, up to some 20 Hz

The residual is that of held-out motion, the deviation that of all recordings: a held-out part that is one slow end
needs hardly any torque of its own.

The twin is held on the measured motion by its observer and fed the measured torque. Its innovation e tells the torque
that its mechanics lack. The scale is that of the twin itself: its innovation is computed a second time, with a constant
torque added. Nothing is simulated in closed loop, where a controller hides what a model lacks. The plain model

    T = J a + D v + Fc sign(v) + T0                    least squares over the measured motion of the training recordings

is what a text book gives. Its residual passes the same filter as the innovation, so that both are compared in one band:

    e(z) = a^2 z^-1 / (1 - (2 - 2 a - a^2) z^-1 + (1 - 2 a) z^-2),   a = T / tau      of a rigid axis
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.twin_deviation import held_on_motor

_SMOOTH_S, _FEWEST = 0.021, 5  # window of the derivatives: passes some 20 Hz; rows of a parabola that averages
_ADDED = 0.01  # of the torque's standard deviation: far above rounding, and an axis that slides goes on sliding
_SLIDING = 0.02  # of the top speed in training: below, the friction of an axis that sticks is not told by its motion


class PlainModel(NamedTuple):
    """Coefficients of the plain model, and the least speed of an axis that slides; motor units."""

    coefficients: FloatArray  # inertia, viscous friction, Coulomb friction, offset
    slowest: float


def fit_plain(data: Dataset) -> PlainModel | None:
    """Fit the plain model to a data set; None without sliding motion."""
    slowest = _SLIDING * max(float(np.max(np.abs(_derivative(run, 1)))) for run in data.runs)
    pairs = [(_regressors(run), _smooth(run.torque, run), _sliding(run, slowest)) for run in data.runs]
    pairs = [(basis[rows], torque[rows], rows) for basis, torque, rows in pairs]
    basis, torque = (np.concatenate([pair[index] for pair in pairs]) for index in (0, 1))
    if basis.shape[0] < 4 * basis.shape[1]:
        return None
    solution, *_ = np.linalg.lstsq(basis, torque, rcond=None)
    return PlainModel(np.asarray(solution, dtype=np.float64), slowest)


def torque_deviation(every: Sequence[Dataset], slowest: float) -> float:
    """Standard deviation of the torque of data sets where the motor is faster than `slowest`; 0 where nothing is."""
    runs = [run for data in every for run in data.runs]
    torque = np.concatenate([_smooth(run.torque, run)[_sliding(run, slowest)] for run in runs])
    return float(np.std(torque)) if torque.size else 0.0


def left_by_plain(model: PlainModel, data: Dataset, deviation: float | None = None) -> float | None:
    """Share of the torque's standard `deviation` that the plain model leaves on a data set; None where nothing slides.

    Without a deviation it is that of the data set.
    """
    found = []
    for run in data.runs:
        missing = run.torque - _regressors(run) @ model.coefficients
        a = run.period_s / data.observer_s
        seen = lfilter([0.0, a * a], [1.0, -(2.0 - 2.0 * a - a * a), 1.0 - 2.0 * a], missing)
        found.append(np.asarray(seen, dtype=np.float64))
    return _share(found, data, model.slowest, deviation)


def left_by_twin(hypothesis: Hypothesis, data: Dataset, slowest: float, deviation: float | None = None) -> float | None:
    """Share of the torque's standard `deviation` that a twin leaves where the motor is faster than `slowest`, or None.

    Without a deviation it is that of the data set.
    """
    found = []
    for run in data.runs:
        rows = _sliding(run, slowest)
        added = _ADDED * float(np.std(run.torque))
        innovation = _innovation(hypothesis, run, data.observer_s)
        moved = _innovation(hypothesis, replace(run, torque=run.torque + added), data.observer_s) - innovation
        scale = float(np.median(moved[rows])) if rows.any() else 0.0
        found.append(innovation * added / scale if scale else np.full(run.motor.size, np.nan))
    return _share(found, data, slowest, deviation)


def _innovation(hypothesis: Hypothesis, run: Measured, observer_s: float) -> FloatArray:
    """Measured less simulated motor position (n,) of a twin held on it."""
    measured, held = held_on_motor(hypothesis, run, observer_s)
    return np.asarray(measured.motor_position - held.motor_position, dtype=np.float64)


def _share(missing: Sequence[FloatArray], data: Dataset, slowest: float, deviation: float | None) -> float | None:
    if not all(np.isfinite(values).all() for values in missing):  # the twin does not hold the motion
        return None
    pairs = zip(missing, data.runs, strict=True)
    left = np.concatenate([_smooth(values, run)[_sliding(run, slowest)] for values, run in pairs])
    deviation = torque_deviation([data], slowest) if deviation is None else deviation
    return float(np.sqrt(np.mean(left**2)) / deviation) if left.size and deviation > 0.0 else None


def _regressors(run: Measured) -> FloatArray:
    """Acceleration, velocity, direction and one (n, 4)."""
    velocity, acceleration = _derivative(run, 1), _derivative(run, 2)
    return np.stack([acceleration, velocity, np.sign(velocity), np.ones_like(velocity)], axis=1)


def _sliding(run: Measured, slowest: float) -> NDArray[np.bool_]:
    """Rows (n,) that are evaluated and in which the axis slides; none of a recording shorter than the filter."""
    window, rows = _window(run), np.zeros(run.motor.size, dtype=bool)
    if run.motor.size < 4 * window:
        return rows
    rows[run.evaluated] = (np.abs(_derivative(run, 1)) > slowest)[run.evaluated]
    rows[:window] = rows[-window:] = False
    return rows


def _derivative(run: Measured, order: int) -> FloatArray:
    if run.motor.size < _window(run):
        return np.zeros(run.motor.size)
    return np.asarray(savgol_filter(run.motor, _window(run), 2, deriv=order, delta=run.period_s), dtype=np.float64)


def _smooth(values: FloatArray, run: Measured) -> FloatArray:
    if values.size < _window(run):
        return values
    return np.asarray(savgol_filter(values, _window(run), 2), dtype=np.float64)


def _window(run: Measured) -> int:
    return max(round(_SMOOTH_S / run.period_s) | 1, _FEWEST)
