"""Current loop lag: the current follows its command late."""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts

_HIDDEN = 1  # variant
_TAKEN_BACK = 2.0  # a lag up to this times the delay against it is mostly taken back


@njit
def _lagging_current(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    # memory: torque at the end of the last step; 1 after the first step
    if memory[1] == 0.0:
        memory[0] = value
        memory[1] = 1.0
    time_constant_s = parameters[0]
    behind = memory[0] - value
    if time_constant_s <= 0.0:
        memory[0] = value
        return value
    # exact for a command held over the step; the mean over the step acts
    gone = -math.expm1(-at.step_s / time_constant_s)
    memory[0] = value + behind * (1.0 - gone)
    return value + behind * gone * time_constant_s / at.step_s


def _late(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that no delay takes back most of a lag that is not recorded: only its curvature would be told.

    A torque that is recorded after it acts is a measured one, which shows a lag of the current.
    """
    return variant != _HIDDEN or values[0] > -_TAKEN_BACK * axis.torque_delay_s


MECHANISM = Mechanism(
    id="current_loop_lag",
    block=Block.DRIVE,
    element="current loop of the drive",
    equation="tau dT/dt = u - T",
    source="Leonhard, Control of Electrical Drives, 3rd ed. (2001), current loop as an equivalent lag",
    parameters=(Parameter("time_constant_s", Dimension.TIME, 1e-5, 0.05, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.CURRENT, _lagging_current, "measured"),
        Variant(Stage.TORQUE, _lagging_current, "hidden"),
    ),
    text=Text("The motor current follows its command with a time constant of {time_constant_s}.", Picture.DELAY),
    search=SearchHints(lambda s: [(2e-4,), (1e-3,)], lambda a: (5e-4,), proportional=False),
    can_be=_late,
)
