"""Asymmetric friction: Coulomb friction differs by direction."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _shifted_band(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    return value + parameters[0]


MECHANISM = Mechanism(
    id="asymmetric_friction",
    block=Block.MOTOR_SIDE,
    element="ball nut, seals and guideways",
    sentence="Friction in positive direction is {offset_torque_n_m} above the mean of both directions.",
    equation="T_f = Fc sign(v) + T_0; at rest T_0 - Fc <= T_f <= T_0 + Fc",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083, direction dependence",
    parameters=(Parameter("offset_torque_n_m", Dimension.TORQUE, -1e3, 1e3),),
    stage=Stage.BIAS,
    contribution=_shifted_band,
)
