"""Thermal growth: the screw grows away from its fixed bearing while the axis runs."""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import ANYWHERE, Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts

_FARTHER_M = 0.1  # a change of the place of the bearing that matters
_FASTEST_S = 1.5  # near the lower bound: what grows at once is another lead, or another ratio


@njit
def _grown_lead(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    growth, time_constant_s = parameters[0], parameters[1]
    if time_constant_s > 0.0:
        growth *= -math.expm1(-at.time_s / time_constant_s)
    return value + growth * (at.table_position_m - parameters[2]) / at.ratio_m


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the growth takes time."""
    return values[1] > _FASTEST_S


MECHANISM = Mechanism(
    id="thermal_growth",
    block=Block.TRANSMISSION,
    element="ball screw",
    equation="x = r theta + g (1 - exp(-t/tau)) (r theta - x0), x0 the fixed bearing",
    source="ISO 230-3, thermal effects; Bryan, CIRP Annals 39 (1990) 645",
    parameters=(
        Parameter("relative_growth", Dimension.RATIO, -5e-3, 5e-3, role=Role.STRENGTH),
        Parameter("time_constant_s", Dimension.TIME, 1.0, 1e4),
        Parameter("bearing_m", Dimension.LENGTH, -ANYWHERE, ANYWHERE, default=0.0, scale=_FARTHER_M),
    ),
    variants=(Variant(Stage.TRANSMISSION, _grown_lead),),
    text=Text(
        "The screw grows by {relative_growth} of its length as it warms up, within about {time_constant_s}.",
        Picture.GROWTH,
        rate="The screw grows by {rate} of its length per minute while it is recorded; where it ends is not told.",
    ),
    search=SearchHints(
        lambda s: [(1e-6 / s.travel_m, f * s.duration_s, 0.0) for f in (0.2, 1.0, 5.0)],
        lambda a: (50e-6, 1800.0, 0.0),
        needs_table=True,
    ),
    can_be=_valid,
)
