"""Encoder eccentricity: the motor encoder errs once per revolution.

On a linear axis, whose motor encoder reads metres, the amplitude is in metres too.
"""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _eccentric_reading(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0] * math.sin(at.angle_rad + parameters[1])


MECHANISM = Mechanism(
    id="encoder_eccentricity",
    block=Block.SENSOR,
    element="motor encoder",
    equation="theta_read = theta + A sin(theta + phi), A = eccentricity / graduation radius",
    source="Heidenhain, Angle Encoders without Integral Bearing (catalogue), eccentricity of the graduation",
    parameters=(
        Parameter("amplitude_rad", Dimension.ANGLE, 0.0, 0.1, role=Role.STRENGTH),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.MOTOR_READING, _eccentric_reading),),
    text=Text(
        "The motor encoder sits off centre: it errs by {amplitude_rad} once per revolution.", Picture.MOTOR_READING
    ),
    search=SearchHints(typical=lambda a: (2e-4 / a.angle_per_unit, 0.0)),
)
