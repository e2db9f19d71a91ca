"""Interpolation error of the scale: the linear encoder errs within its signal period."""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts, Scene


@njit
def _interpolated_reading(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    amplitude_m, period_m, phase_rad = parameters[0], parameters[1], parameters[2]
    if period_m <= 0.0:
        return value
    return value + amplitude_m * math.sin(2.0 * math.pi * at.table_position_m / period_m + phase_rad)


_LONGEST_M = 1e-2  # signal period
# Counting errs as a sawtooth, whose fundamental is 1/pi of a count: an amplitude up to a quarter more is counting,
# which has no period longer than a millimetre.
_COUNTING = 1.25 / math.pi
_LONG_PERIOD_M = 1e-3
_OF_THE_SCREW = 1e-3  # relative deviation from a harmonic of the lead: nearer is an error of the screw


def _starts(s: Scene) -> list[tuple[float, ...]]:
    """At the periods of the residual, and at the lead of the screw."""
    lead = [s.lead_m] if s.lead_m < s.travel_m and round(s.lead_m, 9) <= _LONGEST_M else []
    return [(1e-7, period_m, 0.0) for period_m in (*s.scale_periods, *lead)]


def _of_the_screw(values: Sequence[float], axis: AxisFacts) -> bool:
    """True with the period of the lead, a half or a third of it: a scale may have it, and every screw has."""
    waves = 2.0 * math.pi * axis.ratio / (axis.angle_per_unit * values[1])
    return any(abs(waves / order - 1.0) < _OF_THE_SCREW for order in (1, 2, 3))


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the error is more than counting of the linear encoder makes."""
    amplitude_m, period_m, _ = values
    return not axis.table_count_m or period_m > _LONG_PERIOD_M or amplitude_m > _COUNTING * axis.table_count_m


MECHANISM = Mechanism(
    id="scale_interpolation_error",
    block=Block.SENSOR,
    element="linear encoder",
    equation="x_read = x + A sin(2 pi x / p + phi)",
    source="Heydemann, Quadrature fringe measurement errors in interferometers, Applied Optics 20 (1981) 3382",
    parameters=(
        Parameter("amplitude_m", Dimension.LENGTH, 0.0, 1e-4, role=Role.STRENGTH),
        Parameter("period_m", Dimension.LENGTH, 1e-6, _LONGEST_M, role=Role.PERIOD),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.TABLE_READING, _interpolated_reading),),
    text=Text(
        "The linear encoder errs by {amplitude_m} within each signal period of {period_m}.", Picture.SCALE_READING
    ),
    search=SearchHints(_starts, lambda a: (max(0.5 * (a.table_count_m or 1e-7), 1e-7), 20e-6, 0.0), needs_table=True),
    can_be=_valid,
    is_rare=_of_the_screw,
)
