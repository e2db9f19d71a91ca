"""Thermal growth: the screw grows while the axis runs."""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _grown_lead(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    growth, time_constant_s = parameters[0], parameters[1]
    if time_constant_s > 0.0:
        growth *= -math.expm1(-at.time_s / time_constant_s)
    return value + growth * at.table_position_m / at.ratio_m


MECHANISM = Mechanism(
    id="thermal_growth",
    block=Block.TRANSMISSION,
    element="ball screw",
    sentence="The screw grows by {relative_growth} of its length as it warms up, within about {time_constant_s}.",
    equation="x = (1 + g (1 - exp(-t/tau))) r theta",
    source="ISO 230-3, thermal effects; Bryan, CIRP Annals 39 (1990) 645",
    parameters=(
        Parameter("relative_growth", Dimension.RATIO, -5e-3, 5e-3),
        Parameter("time_constant_s", Dimension.TIME, 1.0, 1e4),
    ),
    stage=Stage.TRANSMISSION,
    contribution=_grown_lead,
)
