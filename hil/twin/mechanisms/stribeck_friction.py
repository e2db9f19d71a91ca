"""Stribeck friction: friction falls with speed from its static value."""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _stribeck_level(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    static, stribeck_velocity = parameters[0], parameters[1]
    if stribeck_velocity <= 0.0:
        return value
    return value + (static - value) * math.exp(-((at.velocity / stribeck_velocity) ** 2))


MECHANISM = Mechanism(
    id="stribeck_friction",
    block=Block.MOTOR_SIDE,
    element="ball nut and guideways",
    sentence="Friction falls from {static_torque_n_m} at rest as speed passes {stribeck_velocity_rad_s}.",
    equation="F(v) = Fc + (Fs - Fc) exp(-(v/vs)^2)",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083, Stribeck curve",
    parameters=(
        Parameter("static_torque_n_m", Dimension.TORQUE, 0.0, 1e4),
        Parameter("stribeck_velocity_rad_s", Dimension.MOTOR_SPEED, 1e-5, 1e3),
    ),
    stage=Stage.COULOMB,
    contribution=_stribeck_level,
)
