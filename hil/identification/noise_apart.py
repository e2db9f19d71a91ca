"""Recordings below the noise: no hypothesis gains by passing less of the noise of their torque and motion.

    r(theta) = g w * [K e(theta; smooth) J(theta) / J(theta0) + e(K left)]           without a spring
    r(theta) = g w * [e(theta; smooth) J(theta) / J(theta0) + e(theta0; left) - e(theta0; smooth)]    with springs
    r(theta) = e(theta; measured)                                                    second encoder, with springs
    r(theta) = e(theta; smooth) + [e(theta0; measured) - e(theta0; smooth)]          other channels than the motor
    r(theta) = e(theta0; measured)                                                   other rows, that do not slide

e: residuals block by block; theta0: a reference; J: inertia. Smooth is a recording with a motion without the noise of
its encoder and the torque that the plain model needs for it; left is what that model leaves of the measured torque,
with springs by generalised least squares. The noise of a torque drives a twin, and least squares of e(theta; measured)
prefers an axis that answers less: more inertia, a resonance, a lag (errors in variables; W. E. Deming, Statistical
Adjustment of Data, 1943). Times the inertia, e of a rigid axis is the torque that it lacks, with the same noise for
every hypothesis. What is left enters as it was measured, through the mean K of the measured motion; what a hypothesis
lacks passes the same mean. A resonance would pass less of the noise: there it goes through the reference alone. A
second encoder tells springs by the motion that was measured. So a fit is least squares of the torque; w whitens it by
the autoregressive model of what the plain model leaves, so that slow errors do not hide a faster effect, and g keeps
the rms of e(theta0; measured). About a reversal smoothed motion tells nothing.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset, NoiseApart
from hil.identification.derivatives import MeasuredMotion, later_motion, matched_motion
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import intended_motion, measured_motion, motion_of_set_points
from hil.identification.measured import Measured
from hil.identification.noise_floor import rms
from hil.identification.plain_model import PlainModel, plain_columns
from hil.identification.residual_scales import follows, inertia
from hil.identification.torque_left import observed
from hil.identification.whitening import RANK, filtered, whitening_filter
from hil.identification.windows import quiet_window


def noise_apart(data: Dataset, reference: Hypothesis, plain: PlainModel) -> Dataset:
    """The recordings of a data set with the noise of their torque and motion apart, by the twin of a reference.

    The motion is the intended one; of an axis with springs the smoothed one, through a shorter mean where the encoder
    of its motor is fine.
    """
    return replace(data, apart=tuple(_apart(data, run, reference, plain) for run in data.runs))


def _apart(data: Dataset, run: Measured, reference: Hypothesis, plain: PlainModel) -> NoiseApart:
    own, springs = measured_motion(run), bool(reference.bench.axis.SPRINGS)
    fine = follows(run, springs, data.observer_s)
    moved = _shortly_smoothed(run, plain) if fine else None if springs else motion_of_set_points(run)
    moved, rows = moved or own.moved, own.sliding(plain.slowest)
    taps, gain, window = np.ones(1), 1.0, 0
    needed = np.where(rows, plain.predict(moved), run.torque) if springs else plain.predict(moved)
    smooth = _driven(replace(run, motor=moved.position), needed)
    measured, free = (reference.driven(one, data.observer_s, data.steps, run) for one in (run, smooth))
    noise, of_reference = {name: measured[name] - free[name] for name in measured}, inertia(reference.resolved.bench)
    if rows.any():
        of_model, a = plain.predict(moved if fine else own.moved), run.period_s / data.observer_s
        taps, left = _whitened(np.where(rows, run.torque - of_model, 0.0), moved, rows, plain, a)
        if springs:
            noise["motor"] = (
                reference.driven(_driven(smooth, needed + left), data.observer_s, data.steps, run)["motor"]
                - free["motor"]
            )
        else:
            window, beyond = own.window, observed(np.where(rows, own.torque - of_model, 0.0), a)
            noise["motor"] = -beyond * data.observer_s**2 / of_reference
    apart = NoiseApart(smooth, rows, noise, measured, of_reference, taps, gain, window)
    least = rms(apart.of("motor", free["motor"], of_reference)[rows]) if rows.any() else 0.0
    return apart._replace(gain=rms(measured["motor"][rows]) / least) if least else apart


def _shortly_smoothed(run: Measured, plain: PlainModel) -> MeasuredMotion:
    """The measured motion through the shortest mean in which the torque of its noise is little beside that measured.

    Below a longer one the noise of both is correlated: it would prefer less inertia.
    """
    inertia_of_model = max(abs(plain["inertia"].value), 1e-300)
    window = quiet_window(run.motor, run.noise.motor, run.period_s, 0.0, run.noise.torque / inertia_of_model)
    return matched_motion(run.motor, run.period_s, min(window, measured_motion(run).window))


def _driven(run: Measured, torque: FloatArray) -> Measured:
    """The run with another torque (n,)."""
    return replace(run, torque=torque, torque_command=torque)


def _whitened(
    beyond: FloatArray, moved: MeasuredMotion, rows: NDArray[np.bool_], plain: PlainModel, a: float
) -> tuple[FloatArray, FloatArray]:
    """Filter (k,) that whitens the torque (n,) beyond the plain model behind the observer, and what it leaves (n,).

    The latter by generalised least squares, so that it does not bend the parameters of the plain model.
    """
    columns = np.column_stack([*plain_columns(later_motion(moved, plain.early_rows)).values()])
    seen = np.column_stack([observed(one, a)[rows] for one in (beyond, *columns.T)])
    taps = whitening_filter(seen[:, 0], seen[:, 1:], [rows])
    white = np.column_stack([filtered(one, [rows], taps) for one in seen.T])
    again = columns @ np.linalg.lstsq(white[:, 1:], white[:, 0], RANK)[0]
    return taps, np.where(rows, beyond - again, 0.0)


def smoothed_runs(runs: Sequence[Measured], plain: PlainModel) -> tuple[Measured, ...]:
    """Recordings with smoothed motion and, where the axis slides, the torque that the plain model needs for it."""
    return tuple(_smoothed(run, measured_motion(run).moved, plain) for run in runs)


def intended_runs(runs: Sequence[Measured], plain: PlainModel) -> tuple[Measured, ...]:
    """The same with the intended motion."""
    return tuple(_smoothed(run, intended_motion(run), plain) for run in runs)


def _smoothed(run: Measured, moved: MeasuredMotion, plain: PlainModel) -> Measured:
    torque = np.where(measured_motion(run).sliding(plain.slowest), plain.predict(moved), run.torque)
    return _driven(replace(run, motor=moved.position), torque)
