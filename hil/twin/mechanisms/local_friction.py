"""Local friction: friction is higher or lower in a zone of the travel.

A worn, dirty or dry part of a screw or guideway, a tight cover, or a nut that is tight on a part of the screw.
"""

from hil.twin.mechanism import Block, Mechanism, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.zone import SHAPE, changed_in_zone, edges, is_zone, starts_in

MECHANISM = Mechanism(
    id="local_friction",
    block=Block.MOTOR_SIDE,
    element="ball screw, guideways or covers",
    equation=f"F = Fc (1 + a s(x)), {SHAPE}",
    source="Armstrong-Hélouvry, Control of Machines with Friction (1991), position-dependent friction",
    parameters=(
        Parameter("fraction", Dimension.RATIO, -0.9, 5.0, role=Role.STRENGTH),
        *edges("begin_m", "end_m", "flank_m"),
    ),
    variants=(Variant(Stage.COULOMB, changed_in_zone),),
    text=Text(
        "From {begin_m} to {end_m} of the travel, friction is higher by a share of {fraction}; it changes over "
        "{flank_m} at either end.",
        Picture.FRICTION_OVER_TRAVEL,
        reversed="From {begin_m} to {end_m} of the travel, friction is lower by a share of {fraction}; it changes over "
        "{flank_m} at either end.",
    ),
    search=SearchHints(lambda s: starts_in(s.friction_zones), lambda a: (0.5, 0.1, 0.15, 0.01)),
    can_be=is_zone,
)
