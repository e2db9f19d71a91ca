"""Presliding hysteresis: elastic micro-motion of the contact before it slides."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _contact_stiffness(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    return value + parameters[0]


MECHANISM = Mechanism(
    id="presliding_hysteresis",
    block=Block.MOTOR_SIDE,
    element="ball nut and guideways",
    sentence="Before it slides, the contact yields like a spring of {stiffness_n_m_rad}.",
    equation="F = sigma z, dz/dt = v (1 - sigma z sign(v) / F(v))",
    source="Dahl, A solid friction model (1968); Canudas de Wit et al., IEEE Trans. Automatic Control 40 (1995) 419",
    parameters=(Parameter("stiffness_n_m_rad", Dimension.MOTOR_STIFFNESS, 1.0, 1e10),),
    stage=Stage.BRISTLE,
    contribution=_contact_stiffness,
)
