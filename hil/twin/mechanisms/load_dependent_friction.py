"""Load-dependent friction: a gear, a nut or a worm rubs the more, the more torque it carries.

The load is the torque of the motor less all friction, so that acceleration is load as well as weight. With Coulomb
friction F0 without load, a velocity of sign s, and T the torque less viscous friction and drag:

    T = L + s (F0 + mu |L|)      |L| = |T - s F0| / (1 + s sign(T - s F0) mu)
"""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _loaded_level(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    share = parameters[0]
    towards = at.velocity if at.velocity != 0.0 else at.torque  # at rest the way in which it slides the sooner
    way = 1.0 if towards > 0.0 else -1.0
    carried = at.torque - way * value
    return value + share * abs(carried) / (1.0 + (way if carried > 0.0 else -way) * share)


MECHANISM = Mechanism(
    id="load_dependent_friction",
    block=Block.MOTOR_SIDE,
    element="gear, ball nut or worm",
    equation="F = Fc + mu |L|, L the torque of the motor less the friction",
    source="Bittencourt and Gunnarsson, J. Dyn. Sys., Meas., Control 134 (2012) 051013, friction that grows with the "
    "load torque of a joint",
    parameters=(Parameter("share", Dimension.RATIO, 0.0, 0.5, role=Role.STRENGTH),),
    variants=(Variant(Stage.COULOMB, _loaded_level),),
    text=Text(
        "Friction grows with the load: by a share of {share} of the torque that is carried.", Picture.FRICTION_OVER_LOAD
    ),
    search=SearchHints(lambda s: [(0.05,)], lambda a: (0.1,)),
)
