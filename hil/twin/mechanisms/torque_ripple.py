"""Torque ripple: the torque constant is periodic in the motor angle."""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _rippling_torque(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value * (1.0 + parameters[0] * math.sin(parameters[1] * at.angle_rad + parameters[2]))


MECHANISM = Mechanism(
    id="torque_ripple",
    block=Block.DRIVE,
    element="motor windings and current measurement",
    equation="T = u (1 + a sin(n theta + phi))",
    source="Jahns and Soong, IEEE Trans. Industrial Electronics 43 (1996) 321, ripple torque",
    parameters=(
        Parameter("fraction", Dimension.RATIO, 0.0, 0.5, role=Role.STRENGTH),
        Parameter("cycles_per_rev", Dimension.COUNT, 0.01, 5e3, role=Role.ORDER),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.TORQUE, _rippling_torque),),
    text=Text("The torque per ampere varies by a share of {fraction}, {wave}.", Picture.RIPPLE),
    search=SearchHints(
        lambda s: [(0.01, order, 0.0) for order in dict.fromkeys((*s.ripple_orders, *s.orders))],
        lambda a: (0.02, 6.0, 0.0),
        screw_locked=True,
    ),
    most=2,
)
