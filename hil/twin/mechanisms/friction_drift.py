"""Friction drift: friction changes as the axis warms up, all of it or, as a lubricant thins, its viscous part."""

from hil.twin.mechanism import Block, Mechanism, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.settling import settling

MECHANISM = Mechanism(
    id="friction_drift",
    block=Block.MOTOR_SIDE,
    element="lubricant of nut and bearings",
    equation="F(t) = F (1 + a (1 - exp(-t/tau))); viscous: of the viscous friction alone",
    source="Bittencourt and Gunnarsson, ASME J. Dynamic Systems, Measurement, and Control 134 (2012) 051013",
    parameters=(
        Parameter("fraction", Dimension.RATIO, -0.95, 5.0, role=Role.STRENGTH),
        Parameter("time_constant_s", Dimension.TIME, 1.0, 1e4),
    ),
    variants=(
        Variant(Stage.FRICTION_SCALE, settling),
        Variant(
            Stage.VISCOUS_SCALE,
            settling,
            "viscous",
            text=Text(
                "Viscous friction changes by a share of {fraction} while the axis runs, within about "
                "{time_constant_s}.",
                Picture.VISCOUS_OVER_TIME,
                rate="Viscous friction changes by a share of {rate} per minute while it is recorded; where it ends is "
                "not told.",
            ),
        ),
    ),
    text=Text(
        "Friction changes by a share of {fraction} while the axis runs, within about {time_constant_s}.",
        Picture.FRICTION_OVER_TIME,
        rate="Friction changes by a share of {rate} per minute while it is recorded; where it ends is not told.",
    ),
    search=SearchHints(lambda s: [(0.05, f * s.duration_s) for f in (0.2, 1.0, 5.0)], lambda a: (0.2, 600.0)),
)
