"""Local torque constant: torque per ampere is lower or higher in a zone of the travel.

A weak or lost magnet in the track of a linear motor, or a part of it with another air gap.
"""

from hil.twin.mechanism import Block, Mechanism, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import Scene
from hil.twin.zone import SHAPE, changed_in_zone, edges, is_zone, starts_in


def _starts(scene: Scene) -> list[tuple[float, ...]]:
    """None before a screw or gear, where the motor passes the same magnets all along the travel."""
    return starts_in(scene.torque_zones) if scene.ratio == 1.0 else []


MECHANISM = Mechanism(
    id="local_torque_constant",
    block=Block.DRIVE,
    element="magnets along the travel",
    equation=f"T = u (1 + a s(x)), {SHAPE}",
    source="Gieras, Piech and Tomczuk, Linear Synchronous Motors (2011), air gap and thrust per ampere",
    parameters=(
        Parameter("fraction", Dimension.RATIO, -0.9, 1.0, role=Role.STRENGTH),
        *edges("begin_m", "end_m", "flank_m"),
    ),
    variants=(Variant(Stage.TORQUE, changed_in_zone),),
    text=Text(
        "From {begin_m} to {end_m} of the travel, the torque per ampere is higher by a share of {fraction}; it changes "
        "over {flank_m} at either end.",
        Picture.CONSTANT_OVER_TRAVEL,
        reversed="From {begin_m} to {end_m} of the travel, the torque per ampere is lower by a share of {fraction}; it "
        "changes over {flank_m} at either end.",
    ),
    search=SearchHints(_starts, lambda a: (-0.1, 0.1, 0.2, 0.02)),
    can_be=is_zone,
)
