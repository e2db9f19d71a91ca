"""Torque saturation: the drive gives less than commanded."""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts


@njit
def _limited_torque(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return min(max(value, -parameters[0]), parameters[0])


# A limit is seen as a plateau. Lag and delay of a drive, up to some milliseconds, round a shorter peak of the command
# as a limit would.
_PLATEAU_S = 0.02


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the command stayed at the limit long enough for a plateau."""
    return axis.held_s(values[0]) >= _PLATEAU_S


MECHANISM = Mechanism(
    id="torque_saturation",
    block=Block.DRIVE,
    element="current limit of the drive",
    equation="T = min(max(u, -limit), limit)",
    source="Åström and Rundqwist, Integrator windup and how to avoid it, American Control Conf. (1989) 1693",
    parameters=(Parameter("limit_n_m", Dimension.TORQUE, 1e-3, 1e5, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.CURRENT, _limited_torque, "measured"),
        Variant(Stage.TORQUE, _limited_torque, "hidden"),
    ),
    text=Text("The drive gives at most {limit_n_m}, less than the controller may command.", Picture.CHARACTERISTIC),
    search=SearchHints(
        lambda s: [(f * s.peak_torque,) for f in (0.999, 0.95, 0.85, 0.7)],
        lambda a: (2.5 * a.rated_torque,),
        proportional=False,
    ),
    can_be=_valid,
    neutral=lambda a: math.inf,
)
