"""Recordings whose noise goes through one twin only: no hypothesis gains by passing less of it.

    r(theta) = r(theta, smooth) + [r(reference, measured) - r(reference, smooth)]        where the axis slides
    r(theta) = r(reference, measured)                                                    in the other rows

The noise of a measured torque drives the twin, and that of the encoder corrects it. Least squares of r(theta, measured)
prefers an axis that answers less: more inertia, a resonance, a lag (errors in variables; W. E. Deming, Statistical
Adjustment of Data, 1943). The smooth recording has the smoothed motion and, where the axis slides, the torque that the
plain model needs for it. What it lacks of the recording, effects included, stays in the brackets. About a reversal
smoothed motion tells nothing.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.identification.dataset import Dataset, NoiseApart
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import intended
from hil.identification.measured import Measured
from hil.identification.plain_model import PlainModel
from hil.identification.torque_left import measured_motion


def noise_apart(data: Dataset, reference: Hypothesis, plain: PlainModel) -> Dataset:
    """The recordings of a data set with their noise as it goes through the twin of a reference.

    The motion is the intended one; beside a second encoder, which the measured motion drives, the smoothed one.
    """
    apart = []
    quiet = smoothed_runs if any(run.table_m.size for run in data.runs) else intended_runs
    for run, smooth in zip(data.runs, quiet(data.runs, plain), strict=True):
        measured, free = (reference.blocks(one, data.observer_s, rests=run) for one in (run, smooth))
        noise = {name: measured[name] - free[name] for name in measured}
        apart.append(NoiseApart(smooth, measured_motion(run).sliding(plain.slowest), noise, measured))
    return replace(data, apart=tuple(apart))


def smoothed_runs(runs: Sequence[Measured], plain: PlainModel) -> tuple[Measured, ...]:
    """Recordings with smoothed motion and, where the axis slides, the torque that the plain model needs for it."""
    return tuple(_smoothed(run, run, plain) for run in runs)


def intended_runs(runs: Sequence[Measured], plain: PlainModel) -> tuple[Measured, ...]:
    """The same with the intended motion."""
    return tuple(_smoothed(run, intended(run), plain) for run in runs)


def _smoothed(run: Measured, moves: Measured, plain: PlainModel) -> Measured:
    moved = measured_motion(moves).moved
    torque = np.where(measured_motion(run).sliding(plain.slowest), plain.predict(moved), run.torque)
    return replace(run, motor=moved.position, torque=torque, torque_command=torque)
