"""Saturation of the torque constant: torque per ampere falls with current."""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _saturating_torque_constant(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    falling = parameters[0]
    if falling <= 0.0:
        return value
    most = 1.0 / math.sqrt(3.0 * falling)  # more current gives no more torque from here on
    held = min(max(value, -most), most)
    return held * (1.0 - falling * held * held)


MECHANISM = Mechanism(
    id="torque_constant_saturation",
    block=Block.DRIVE,
    element="motor iron",
    equation="T = u (1 - c u^2) up to where that is greatest, |u| = 1 / sqrt(3 c), and no more beyond",
    source="Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives (2010), magnetic saturation",
    parameters=(Parameter("coefficient_1_n2_m2", Dimension.INVERSE_TORQUE_SQUARED, 0.0, 1.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.TORQUE, _saturating_torque_constant),),
    text=Text(
        "The torque constant falls with current: T = u (1 - c u^2), c = {coefficient_1_n2_m2}.", Picture.CHARACTERISTIC
    ),
    search=SearchHints(lambda s: [(0.02 / s.peak_torque**2,)], lambda a: (0.1 / (3.0 * a.rated_torque) ** 2,)),
)
