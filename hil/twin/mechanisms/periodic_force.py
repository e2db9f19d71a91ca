"""Periodic force: something shakes the table at a fixed frequency, all the time.

Such as an unbalanced fan, a machine beside it or the floor. Its phase is that of the recording's clock: it holds in the
parts of one recording, not in another one, and several recordings without a common clock show no line. A series of
pulses is windows of a force instead.
"""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts

_LEAST_WAVES = 3.3  # two thirds of five, where a third is held out: fewer are a drift
_OWN = 0.5  # share of the motion's energy above which the motion is a swing of this line


@njit
def _shake(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    middle_s = at.time_s + 0.5 * at.step_s
    return value + parameters[0] * math.sin(2.0 * math.pi * parameters[1] * middle_s + parameters[2])


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the recording holds enough waves, that the motion is not itself of this line, and that the line is
    there at any speed.

    Whatever an axis that swings lacks repeats with the swing; what grows with the speed, such as time stamps that are
    late now and then, is no force.
    """
    line_hz = values[1]
    enough = line_hz * axis.duration_s >= _LEAST_WAVES
    return enough and axis.swings(line_hz) < _OWN and not axis.grows_with_speed(line_hz)


MECHANISM = Mechanism(
    id="periodic_force",
    block=Block.TABLE,
    element="surroundings of the table",
    equation="F_table = F sin(2 pi f t + phi)",
    source="ISO 20816-1:2016, vibration of machines; Newton's second law",
    parameters=(
        Parameter("force_n", Dimension.FORCE, 0.0, 1e5, role=Role.STRENGTH),
        Parameter("frequency_hz", Dimension.FREQUENCY, 0.1, 200.0, role=Role.LINE),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.TABLE_FORCE, _shake),),
    text=Text("A force of {force_n} at {frequency_hz} acts on the table all the time.", Picture.FORCE_OVER_TIME),
    search=SearchHints(
        lambda s: [(0.1 * s.coulomb / s.ratio, frequency_hz, 0.0) for frequency_hz in s.lines_hz],
        lambda a: (0.2 * a.friction / a.ratio, 7.0, 0.0),
    ),
    can_be=_valid,
)
