"""Backlash: lost motion between screw and table.

Oiled flanks are held by their damping when they part, dry flanks only push.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _free_play(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    half = 0.5 * parameters[0] / at.ratio_m
    if value > half:
        return value - half
    if value < -half:
        return value + half
    return 0.0


MECHANISM = Mechanism(
    id="backlash",
    block=Block.TRANSMISSION,
    element="ball nut and thrust bearing",
    sentence="There are {gap_m} of lost motion between screw and table.",
    equation="T = k dz(q, gap/2): no torque while |q| < gap/2",
    source="Nordin and Gutman, Automatica 38 (2002) 1633, dead-zone model",
    parameters=(Parameter("gap_m", Dimension.LENGTH, 0.0, 1e-3),),
    stage=Stage.TRANSMISSION,
    contribution=_free_play,
    variants=("oiled flanks", "dry flanks"),
    softens=True,
    play=True,
)
