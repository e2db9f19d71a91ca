"""Local friction: friction is higher or lower in a zone of the travel.

A worn, dirty or dry part of a screw or guideway, a tight cover, or a nut that is tight on a part of the screw.
"""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import ANYWHERE, Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts, Scene

# Shortest flank [m]: an axis needs several internal steps for it, so that the twin is continuous in the edges.
_STEEPEST_M = 1e-3
_LENGTH_M = 0.03  # of a zone
_WHOLE = 0.8  # share of the travel above which a zone is the travel, and its friction that of the axis
_FLANKS = (0.1, 0.8)  # of the length of the zone: steep, and nearly a triangle


@njit
def _level_in_zone(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    fraction, begin_m, end_m, flank_m = parameters[0], parameters[1], parameters[2], parameters[3]
    if flank_m <= 0.0:
        return value
    inside_m = min(at.table_position_m - begin_m, end_m - at.table_position_m)
    return value * (1.0 + fraction * min(max(inside_m / flank_m + 0.5, 0.0), 1.0))


def _is_zone(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """True if the zone is a part of the travel, and most of it is within the travel."""
    _, begin_m, end_m, flank_m = values
    first_m, last_m = axis.positions_m
    inside_m = min(end_m, last_m) - max(begin_m, first_m)
    return flank_m <= end_m - begin_m <= min(_WHOLE * axis.travel_m, 2.0 * inside_m)


def _starts(scene: Scene) -> list[tuple[float, ...]]:
    return [
        (level / scene.coulomb, begin_m, end_m, flank * (end_m - begin_m))
        for begin_m, end_m, level in scene.friction_zones
        for flank in _FLANKS
    ]


MECHANISM = Mechanism(
    id="local_friction",
    block=Block.MOTOR_SIDE,
    element="ball screw, guideways or covers",
    equation="F = Fc (1 + a s(x)), s = 1 in the zone, 0 outside, straight flanks; half height at its begin and end",
    source="Armstrong-Hélouvry, Control of Machines with Friction (1991), position-dependent friction",
    parameters=(
        Parameter("fraction", Dimension.RATIO, -0.9, 5.0, role=Role.STRENGTH),
        Parameter("begin_m", Dimension.LENGTH, -ANYWHERE, ANYWHERE, scale=_LENGTH_M),
        Parameter("end_m", Dimension.LENGTH, -ANYWHERE, ANYWHERE, scale=_LENGTH_M),
        Parameter("flank_m", Dimension.LENGTH, _STEEPEST_M, ANYWHERE),
    ),
    variants=(Variant(Stage.COULOMB, _level_in_zone),),
    text=Text(
        "From {begin_m} to {end_m} of the travel, friction is higher by a share of {fraction}; it changes over "
        "{flank_m} at either end.",
        Picture.FRICTION_OVER_TRAVEL,
        reversed="From {begin_m} to {end_m} of the travel, friction is lower by a share of {fraction}; it changes over "
        "{flank_m} at either end.",
    ),
    search=SearchHints(_starts, lambda a: (0.5, 0.1, 0.15, 0.01)),
    can_be=_is_zone,
)
