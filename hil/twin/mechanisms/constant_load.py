"""Constant load: a weight that the motor has to hold, a preload, or an offset of the torque channel.

A positive load pulls the axis in the negative direction: it takes a positive motor torque to hold it.
"""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _load(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value - parameters[0]


MECHANISM = Mechanism(
    id="constant_load",
    block=Block.MOTOR_SIDE,
    element="weight or counterbalance of the axis",
    equation="T = u - T_load",
    source="Groß, Hamann and Wiegärtner, Electrical Feed Drives in Automation (2001), weight of an axis",
    parameters=(Parameter("load_torque_n_m", Dimension.TORQUE, -1e4, 1e4, role=Role.STRENGTH),),
    variants=(Variant(Stage.MOTOR_TORQUE, _load),),
    text=Text(
        "A constant load of {load_torque_n_m}: a weight, a preload, or an offset of the torque channel.",
        Picture.FRICTION,
    ),
    search=SearchHints(typical=lambda a: (0.1 * a.friction,)),
)
