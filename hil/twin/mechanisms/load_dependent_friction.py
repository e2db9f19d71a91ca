"""Load-dependent friction: a gear, a nut or a worm rubs the more, the more torque it carries.

The torque of the motor stands for the load that is carried: of a joint or of a vertical axis most of it is weight.
"""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _loaded_level(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0] * abs(at.torque)


MECHANISM = Mechanism(
    id="load_dependent_friction",
    block=Block.MOTOR_SIDE,
    element="gear, ball nut or worm",
    equation="F = Fc + mu |T|, T the torque of the motor",
    source="Bittencourt and Gunnarsson, J. Dyn. Sys., Meas., Control 134 (2012) 051013, friction that grows with the "
    "load torque of a joint",
    parameters=(Parameter("share", Dimension.RATIO, 0.0, 0.8, role=Role.STRENGTH),),
    variants=(Variant(Stage.COULOMB, _loaded_level),),
    text=Text("Friction grows with the load: by a share of {share} of the motor's torque.", Picture.FRICTION_OVER_LOAD),
    search=SearchHints(lambda s: [(0.05,)], lambda a: (0.1,)),
)
