"""Preload loss: the transmission is soft around zero load."""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.mechanisms import table_side_friction
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts

_PLAY = 0.05  # stiffness left below which the zone is play: a nut that has lost its preload keeps a tenth to a half


@njit
def _soft_zone(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    half, ratio = 0.5 * parameters[0] / at.ratio_m, parameters[1]
    if value > half:
        return value - (1.0 - ratio) * half
    if value < -half:
        return value + (1.0 - ratio) * half
    return ratio * value


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the transmission leaves the zone, and that a spring is left in it: else it is softer, or has play."""
    return values[0] <= axis.lost_m and values[1] >= _PLAY


MECHANISM = Mechanism(
    id="preload_loss",
    block=Block.TRANSMISSION,
    element="preload of ball nut and thrust bearing",
    equation="T = k e(q), de/dq = rho for |q| < zone/2, else 1",
    source="ISO 3408-4:2006, axial rigidity of preloaded nuts; Feng and Pan, Int. J. Machine Tools 52 (2012) 85",
    parameters=(
        Parameter("zone_m", Dimension.LENGTH, 0.0, 0.05, role=Role.STRENGTH),
        Parameter("stiffness_ratio", Dimension.RATIO, 0.0, 1.0),
    ),
    variants=(Variant(Stage.TRANSMISSION, _soft_zone),),
    text=Text(
        "Over {zone_m} around zero load the transmission has {stiffness_ratio} of its stiffness: preload is lost.",
        Picture.LOST_MOTION,
    ),
    search=SearchHints(
        lambda s: (
            [(f * s.stretch, 0.4) for f in (0.5, 1.0, 2.0)] + [(f * s.most_stretch, 0.4) for f in (0.5, 1.0, 1.5)]
        ),
        lambda a: (3e-6, 0.5),
        proportional=False,
        needs_table=True,
        beside=table_side_friction.MECHANISM.id,
        restarts=lambda stretch_m: [(f * stretch_m, ratio) for f, ratio in ((1.0, 0.15), (1.0, 0.4), (0.5, 0.15))],
    ),
    can_be=_valid,
    softens=True,
)
