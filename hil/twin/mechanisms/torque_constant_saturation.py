"""Saturation of the torque constant: torque per ampere falls with current."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _saturating_torque_constant(
    value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]
) -> float:
    return value * max(1.0 - parameters[0] * value * value, 0.0)


MECHANISM = Mechanism(
    id="torque_constant_saturation",
    block=Block.DRIVE,
    element="motor iron",
    sentence="The torque constant falls with current: T = u (1 - c u^2), c = {coefficient_1_n2_m2}.",
    equation="T = u max(1 - c u^2, 0)",
    source="Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives (2010), magnetic saturation",
    parameters=(Parameter("coefficient_1_n2_m2", Dimension.INVERSE_TORQUE_SQUARED, 0.0, 1.0),),
    stage=Stage.TORQUE,
    contribution=_saturating_torque_constant,
)
