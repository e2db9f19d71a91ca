"""Thresholds of the twin's residual from recordings without fault."""

from collections.abc import Iterable

import numpy as np

from hil.bench.supervision_section import ResidualThresholds
from hil.errors import InputError
from hil.recording.recording import Recording

MARGIN = 3.0  # of the largest residual: the next run has other temperatures and loads


def learn(recordings: Iterable[Recording], ratio_m_rad: float) -> ResidualThresholds:
    """Return MARGIN x the largest residuals of recordings with the channels of the live twin.

    ratio_m_rad: travel of the table per motor unit (1 on a linear axis). Raises InputError without recordings or
    without channels of a twin.
    """
    motor, table, torque = 0.0, 0.0, 0.0
    count = 0
    for recording in recordings:
        count += 1
        names = recording.axis
        motor = max(motor, ratio_m_rad * _largest(recording, names.motor_position))
        torque = max(torque, _largest(recording, names.torque))
        if names.table_position in recording.columns:
            table = max(table, _largest(recording, names.table_position))
    if not count or not motor or not torque:
        raise InputError("given no recording with a residual, allowed runs of the bench without fault; record one")
    return ResidualThresholds(motor_m=MARGIN * motor, table_m=MARGIN * table or None, torque=MARGIN * torque)


def _largest(recording: Recording, name: str) -> float:
    return float(np.max(np.abs(recording[name] - recording[f"twin_{name}"])))
