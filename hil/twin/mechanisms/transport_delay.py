"""Transport delay: the torque command acts late."""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture

_OLDEST = 14  # age in ticks of the oldest command kept: 12 ticks of delay, a fraction, and its step
_MOST_S = 0.012
_STARTED = 15  # memory[_STARTED] is 0 until the first command has come


@njit
def _delayed_command(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    # memory[j] is the command of j ticks ago; before the first one the command was the same
    if at.within_s == 0.0:
        for age in range(_OLDEST, 0, -1):
            memory[age] = memory[age - 1] if memory[_STARTED] != 0.0 else value
        memory[0] = value
        memory[_STARTED] = 1.0
    # The mean over this step, so that the answer is continuous in the delay
    first = min(max((parameters[0] - at.within_s) / at.period_s, 0.0), _OLDEST - 1.0)
    last = min(max((parameters[0] - at.within_s - at.step_s) / at.period_s, 0.0), _OLDEST - 1.0)
    older = math.ceil(first - 1e-9)
    newer = math.ceil(last - 1e-9)
    if older == newer:
        return memory[newer]
    share = (first - newer) * at.period_s / at.step_s
    return share * memory[older] + (1.0 - share) * memory[newer]


MECHANISM = Mechanism(
    id="transport_delay",
    block=Block.DRIVE,
    element="fieldbus and drive processing",
    equation="T(t) = u(t - delay), u held over a control period",
    source="Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. (1997), systems with time delay",
    parameters=(Parameter("delay_s", Dimension.TIME, 0.0, _MOST_S, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.CURRENT, _delayed_command, "measured"),
        Variant(Stage.TORQUE, _delayed_command, "hidden", moves_torque=True),
    ),
    text=Text("The torque command acts {delay_s} later than the controller believes.", Picture.DELAY),
    search=SearchHints(
        lambda s: [(delay_s,) for delay_s in (1.5e-4, 7e-4, *s.delays_s(0.0, _MOST_S))],
        lambda a: (5e-4,),
        proportional=False,
        shifts_time=True,
    ),
)
