"""Interpolation error of the scale: the linear encoder errs within its signal period."""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _interpolated_reading(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    amplitude_m, period_m, phase_rad = parameters[0], parameters[1], parameters[2]
    if period_m <= 0.0:
        return value
    return value + amplitude_m * math.sin(2.0 * math.pi * at.table_position_m / period_m + phase_rad)


MECHANISM = Mechanism(
    id="scale_interpolation_error",
    block=Block.SENSOR,
    element="linear encoder",
    sentence="The linear encoder errs by {amplitude_m} within each signal period of {period_m}.",
    equation="x_read = x + A sin(2 pi x / p + phi)",
    source="Heydemann, Quadrature fringe measurement errors in interferometers, Applied Optics 20 (1981) 3382",
    parameters=(
        Parameter("amplitude_m", Dimension.LENGTH, 0.0, 1e-4),
        Parameter("period_m", Dimension.LENGTH, 1e-6, 1e-2),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi),
    ),
    stage=Stage.TABLE_READING,
    contribution=_interpolated_reading,
)
