"""Gravity torque: the weight of an arm or a pendulum that turns about a horizontal axis.

The load's angle is 0 where the recording has its zero; `angle_rad` is that angle seen from straight down.
"""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.mechanisms.constant_load import MECHANISM as LOAD
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts


@njit
def _pull_down(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value - parameters[0] * math.sin(at.table_position_m + parameters[1])


def _load(values: Sequence[float], axis: AxisFacts) -> tuple[str, tuple[float, ...]]:
    """The constant load with the torque of gravity in the middle of the arc: all that a short one tells."""
    return LOAD.id, (values[0] * math.sin(axis.middle_m + values[1]) * axis.ratio,)


MECHANISM = Mechanism(
    id="gravity_torque",
    block=Block.TABLE,
    element="weight of the arm",
    equation="T_load = -m g r sin(q + q0)",
    source="Spong, Hutchinson and Vidyasagar, Robot Modeling and Control (2006), sec. 7.4, gravity of a link",
    parameters=(
        Parameter("gravity_torque_n_m", Dimension.TORQUE, 0.0, 1e5, role=Role.STRENGTH),
        Parameter("angle_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.TABLE_FORCE, _pull_down),),
    text=Text("Gravity turns the load with up to {gravity_torque_n_m}.", Picture.FORCE_OVER_TRAVEL),
    search=SearchHints(lambda s: [(0.1 * s.coulomb / s.ratio, 0.0)], lambda a: (0.5 * a.friction / a.ratio, 0.0)),
    told_by_m=lambda values, a: 0.0,
    beyond=_load,
    turning=True,
)
