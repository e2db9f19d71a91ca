"""Torque constant gradient: torque per ampere rises or falls steadily along the travel.

A magnet track whose air gap, magnets or temperature differ from end to end.
"""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _rising_torque_constant(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value * max(1.0 + parameters[0] * at.table_position_m, 0.0)


MECHANISM = Mechanism(
    id="torque_constant_gradient",
    block=Block.DRIVE,
    element="magnets along the travel",
    equation="T = u (1 + s x)",
    source="Gieras, Piech and Tomczuk, Linear Synchronous Motors (2011), air gap and thrust per ampere",
    parameters=(Parameter("slope_1_m", Dimension.PER_LENGTH, -20.0, 20.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.TORQUE, _rising_torque_constant),),
    text=Text(
        "The torque per ampere changes along the travel by {slope_1_m}, as a share of that at position zero.",
        Picture.CONSTANT_OVER_TRAVEL,
    ),
)
