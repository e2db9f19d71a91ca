"""Cogging torque: the magnets pull towards the teeth, independent of the current."""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _cogging(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0] * math.sin(parameters[1] * at.angle_rad + parameters[2])


MECHANISM = Mechanism(
    id="cogging_torque",
    block=Block.MOTOR_SIDE,
    element="motor magnets and teeth",
    equation="T = u + A sin(n theta + phi)",
    source="Jahns and Soong, IEEE Trans. Industrial Electronics 43 (1996) 321, cogging torque",
    parameters=(
        Parameter("amplitude_n_m", Dimension.TORQUE, 0.0, 1e3, role=Role.STRENGTH),
        Parameter("cycles_per_rev", Dimension.COUNT, 0.01, 5e3, role=Role.ORDER),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.MOTOR_TORQUE, _cogging),),
    text=Text("The motor cogs with {amplitude_n_m}, {wave}.", Picture.COGGING),
    search=SearchHints(
        lambda s: [(0.01 * s.coulomb, order, 0.0) for order in s.orders],
        lambda a: (0.02 * a.rated_torque, 12.0, 0.0),
        screw_locked=True,
    ),
    most=4,
)
