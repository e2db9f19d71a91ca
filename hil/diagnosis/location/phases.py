"""Phases of a motion, row by row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.result import PhaseKind
from hil.identification.dataset import Measured

CREEP = 0.05  # of the top speed
ACCELERATING = 0.02  # of the top acceleration
AFTER_REVERSAL_S = 0.06  # the flanks and the friction have turned round by then


def phases(run: Measured) -> NDArray[np.str_]:
    """The phase (n,) of each row, by its set-points; a reversal lasts until the axis has turned round."""
    speed = run.velocity_command_m_s
    top = float(np.max(np.abs(speed))) or 1.0
    acceleration = np.gradient(speed, run.period_s)
    moving = np.abs(speed) > 1e-3 * top
    kinds = np.full(speed.size, PhaseKind.CONSTANT_FEED.value, dtype="<U16")
    kinds[np.abs(acceleration) > ACCELERATING * float(np.max(np.abs(acceleration)))] = PhaseKind.ACCELERATION.value
    kinds[np.abs(speed) < CREEP * top] = PhaseKind.CREEP.value
    kinds[~moving] = PhaseKind.STANDSTILL.value
    rows = np.flatnonzero(moving)
    turns = rows[1:][np.diff(np.sign(speed[rows])) != 0.0]
    for turn in turns:
        kinds[turn : turn + round(AFTER_REVERSAL_S / run.period_s)] = PhaseKind.REVERSAL.value
    return kinds
