"""Trigger of the scope: the first row at which a trace passes a level, or at which an event begins.

Rows are searched as they come; the result does not depend on how they are cut into blocks.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from drivers.cia402 import DriveState
from hil.arrays import FloatArray


class Slope(StrEnum):
    """Direction in which the level is passed."""

    RISING = "rising"
    FALLING = "falling"
    EITHER = "either"


class ScopeEvent(StrEnum):
    """Events that a row tells."""

    FAULT = "fault"  # the drive is in the CiA 402 states fault or fault reaction, or has an error code
    STATE = "change of state"
    SEGMENT = "change of segment"
    STOP = "stop"  # set-points of a stop


def crossings(values: FloatArray, level: float, slope: Slope) -> NDArray[np.intp]:
    """Rows i of a trace (n,) at which it has reached `level` from the side on which row i - 1 lies."""
    before, after = values[:-1], values[1:]
    rising, falling = (before < level) & (after >= level), (before > level) & (after <= level)
    passed = {Slope.RISING: rising, Slope.FALLING: falling, Slope.EITHER: rising | falling}[slope]
    return np.flatnonzero(passed) + 1


def beginnings(columns: Mapping[str, FloatArray], event: ScopeEvent) -> NDArray[np.intp]:
    """Rows at which an event begins; none where its channels are not recorded."""
    zeros = np.zeros(len(columns["time_s"]))
    state, segment = columns.get("drive_state", zeros), columns.get("segment", zeros)
    if event is ScopeEvent.STATE or event is ScopeEvent.SEGMENT:
        return np.flatnonzero(np.diff(state if event is ScopeEvent.STATE else segment)) + 1
    if event is ScopeEvent.STOP:
        holds = segment < 0.0
    else:
        faulty = (state == DriveState.FAULT) | (state == DriveState.FAULT_REACTION_ACTIVE)
        holds = faulty | (columns.get("drive_error_code", zeros) != 0.0)
    return np.flatnonzero(holds[1:] & ~holds[:-1]) + 1
