"""Eccentricity of the load's encoder: the second encoder of a rotary axis errs once per revolution of the load.

A wheel on the load's shaft that runs out looks the same where the load turns slowly. On a gear of ratio n the motor's
encoder errs n times as often; with n = 1 only the control loop tells the two encoders apart.
"""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _eccentric_reading(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0] * math.sin(at.table_position_m + parameters[1])


MECHANISM = Mechanism(
    id="load_encoder_eccentricity",
    block=Block.SENSOR,
    element="load encoder, or the last wheel of the gear",
    equation="q_read = q + A sin(q + phi), A = eccentricity / graduation radius",
    source="Heidenhain, Angle Encoders without Integral Bearing (catalogue), eccentricity of the graduation",
    parameters=(
        Parameter("amplitude_rad", Dimension.ANGLE, 0.0, 0.1, role=Role.STRENGTH),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.TABLE_READING, _eccentric_reading),),
    text=Text(
        "The load encoder, or the wheel that turns the load, sits off centre: the encoders differ by {amplitude_rad} "
        "once per revolution of the load.",
        Picture.LOAD_READING,
    ),
    search=SearchHints(lambda s: [(1e-5, 0.0)], lambda a: (2e-4, 0.0), needs_table=True),
    turning=True,
)
