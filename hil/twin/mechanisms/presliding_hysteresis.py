"""Presliding hysteresis: elastic micro-motion of the contact before it slides."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _contact_stiffness(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    return value + parameters[0]


MECHANISM = Mechanism(
    id="presliding_hysteresis",
    block=Block.MOTOR_SIDE,
    element="ball nut and guideways",
    sentence="Before it slides, the contact yields like a spring of {stiffness_n_m_rad}.",
    second_sentence="Before it slides, the contact yields like a spring of {stiffness_n_m_rad}, and like it again from "
    "wherever it turns.",
    equation="F = sigma z, dz/dt = v (1 - sigma z sign(v) / F(v)); Maxwell slip: F = sum of f_i, df_i/dt = k_i v while "
    "|f_i| < y_i",
    source="Dahl, A solid friction model (1968); Canudas de Wit et al., IEEE Trans. Automatic Control 40 (1995) 419; "
    "Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control 50 (2005) 1883",
    parameters=(Parameter("stiffness_n_m_rad", Dimension.MOTOR_STIFFNESS, 1.0, 1e10),),
    stage=Stage.BRISTLE,
    contribution=_contact_stiffness,
    variants=("Dahl", "Maxwell slip"),
    slips=True,
)
