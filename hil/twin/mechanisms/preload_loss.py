"""Preload loss: the transmission is soft around zero load."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _soft_zone(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    half, ratio = 0.5 * parameters[0] / at.ratio_m, parameters[1]
    if value > half:
        return value - (1.0 - ratio) * half
    if value < -half:
        return value + (1.0 - ratio) * half
    return ratio * value


MECHANISM = Mechanism(
    id="preload_loss",
    block=Block.TRANSMISSION,
    element="preload of ball nut and thrust bearing",
    sentence="Over {zone_m} around zero load the transmission has {stiffness_ratio} of its stiffness: preload is lost.",
    equation="T = k e(q), de/dq = rho for |q| < zone/2, else 1",
    source="ISO 3408-4:2006, axial rigidity of preloaded nuts; Feng and Pan, Int. J. Machine Tools 52 (2012) 85",
    parameters=(
        Parameter("zone_m", Dimension.LENGTH, 0.0, 1e-3),
        Parameter("stiffness_ratio", Dimension.RATIO, 0.0, 1.0),
    ),
    stage=Stage.TRANSMISSION,
    contribution=_soft_zone,
    softens=True,
)
