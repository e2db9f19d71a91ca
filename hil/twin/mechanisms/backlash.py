"""Backlash: lost motion between screw and table.

Damping resists the parting of oiled flanks; dry flanks only push.
"""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Contact, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.mechanisms import table_side_friction
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts


@njit
def _free_play(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    half = 0.5 * parameters[0] / at.ratio_m
    if value > half:
        return value - half
    if value < -half:
        return value + half
    return 0.0


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the table crosses the gap: in a wider one it floats, and shows nothing of its width."""
    return values[0] <= axis.lost_m


MECHANISM = Mechanism(
    id="backlash",
    block=Block.TRANSMISSION,
    element="ball nut and thrust bearing",
    equation="T = k dz(q, gap/2): no torque while |q| < gap/2",
    source="Nordin and Gutman, Automatica 38 (2002) 1633, dead-zone model",
    parameters=(Parameter("gap_m", Dimension.LENGTH, 0.0, 0.05, role=Role.STRENGTH),),
    variants=(
        Variant(
            Stage.TRANSMISSION,
            _free_play,
            "oiled flanks",
            text=Text("There are {gap_m} of lost motion between screw and table (oiled flanks resist parting)."),
        ),
        Variant(
            Stage.TRANSMISSION,
            _free_play,
            "dry flanks",
            text=Text("There are {gap_m} of lost motion between screw and table (dry flanks only push)."),
            contact=Contact.PLAY,
        ),
    ),
    text=Text("There are {gap_m} of lost motion between screw and table.", Picture.LOST_MOTION),
    search=SearchHints(
        starts=lambda s: [(f * s.stretch,) for f in (0.5, 1.0, 2.0, 4.0)],
        proportional=False,
        needs_table=True,
        beside=table_side_friction.MECHANISM.id,
    ),
    can_be=_valid,
    softens=True,
)
