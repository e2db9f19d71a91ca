"""Torque saturation: the drive gives less than commanded."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _limited_torque(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    return min(max(value, -parameters[0]), parameters[0])


MECHANISM = Mechanism(
    id="torque_saturation",
    block=Block.DRIVE,
    element="current limit of the drive",
    sentence="The drive gives at most {limit_n_m}, less than the controller may command.",
    equation="T = min(max(u, -limit), limit)",
    source="Åström and Rundqwist, Integrator windup and how to avoid it, American Control Conf. (1989) 1693",
    parameters=(Parameter("limit_n_m", Dimension.TORQUE, 1e-3, 1e5),),
    stage=Stage.CURRENT,
    contribution=_limited_torque,
    variants=("measured", "hidden"),
    second_stage=Stage.TORQUE,
)
