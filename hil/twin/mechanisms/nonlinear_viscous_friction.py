"""Nonlinear viscous friction: drag beyond linear in speed."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _quadratic_drag(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    return value + parameters[0] * at.velocity * abs(at.velocity)


MECHANISM = Mechanism(
    id="nonlinear_viscous_friction",
    block=Block.MOTOR_SIDE,
    element="lubricant of nut and bearings",
    sentence="Drag departs from linear in speed by {quadratic_n_m_s2_rad2} times the square of the speed.",
    equation="F = Fc sign(v) + c v + q v |v|; q < 0 where the lubricant thins with speed",
    source="Olsson et al., Friction models and friction compensation, European J. Control 4 (1998) 176",
    parameters=(Parameter("quadratic_n_m_s2_rad2", Dimension.MOTOR_DRAG, -1e5, 1e5),),
    stage=Stage.DRAG,
    contribution=_quadratic_drag,
)
