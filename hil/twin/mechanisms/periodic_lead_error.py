"""Periodic lead error: the table runs ahead and behind with the angle of the screw."""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _wobble(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    order = 1.0 + parameters[3]
    return value + parameters[0] / at.ratio_m * math.sin(order * at.angle_rad + parameters[1])


MECHANISM = Mechanism(
    id="periodic_lead_error",
    block=Block.TRANSMISSION,
    element="ball screw",
    sentence="The lead errs by {amplitude_m}, periodic in the angle of the screw.",
    equation="x = r theta + A sin(n theta + phi), n = 1, 2, 3",
    source="ISO 3408-3:2006, travel variation within 2 pi rad; ISO 230-2, bidirectional positioning",
    parameters=(
        Parameter("amplitude_m", Dimension.LENGTH, 0.0, 1e-3),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi),
    ),
    stage=Stage.TRANSMISSION,
    contribution=_wobble,
    variants=("once per revolution", "twice per revolution", "three times per revolution"),
)
