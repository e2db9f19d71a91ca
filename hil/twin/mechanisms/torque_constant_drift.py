"""Torque constant drift: torque per ampere falls as the magnets warm up, or as the supply sags."""

from hil.twin.mechanism import Block, Mechanism, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.settling import settling

MECHANISM = Mechanism(
    id="torque_constant_drift",
    block=Block.DRIVE,
    element="magnets, or supply of the drive",
    equation="T = u (1 + a (1 - exp(-t/tau)))",
    source="Sebastian, IEEE Trans. Industry Applications 31 (1995) 353-357",
    parameters=(
        Parameter("fraction", Dimension.RATIO, -0.5, 0.5, role=Role.STRENGTH),
        Parameter("time_constant_s", Dimension.TIME, 1.0, 1e4),
    ),
    variants=(Variant(Stage.TORQUE, settling),),
    text=Text(
        "The torque per ampere changes by a share of {fraction} while the axis runs, within about {time_constant_s}.",
        Picture.CONSTANT_OVER_TIME,
        rate="The torque per ampere changes by a share of {rate} per minute while it is recorded; where it ends is not "
        "told.",
    ),
    search=SearchHints(lambda s: [(0.05, f * s.duration_s) for f in (0.2, 1.0, 5.0)], lambda a: (0.05, 600.0)),
)
