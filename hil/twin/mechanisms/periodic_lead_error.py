"""Periodic lead error: the table runs ahead and behind with the angle of the screw.

The error of a ground screw is rarely a pure sine: three harmonics count as one cause.
"""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _wobble(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    error = 0.0
    for harmonic in range(3):
        amplitude_m, phase = parameters[2 * harmonic], parameters[2 * harmonic + 1]
        if amplitude_m != 0.0:
            error += amplitude_m * math.sin((harmonic + 1) * at.angle_rad + phase)
    return value + error / at.ratio_m


MECHANISM = Mechanism(
    id="periodic_lead_error",
    block=Block.TRANSMISSION,
    element="ball screw",
    equation="x = r theta + sum over n = 1, 2, 3 of A_n sin(n theta + phi_n)",
    source="ISO 3408-3:2006, travel variation within 2 pi rad; ISO 230-2, bidirectional positioning",
    parameters=(
        Parameter("amplitude_m", Dimension.LENGTH, 0.0, 1e-3, role=Role.STRENGTH),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
        Parameter("amplitude_2_m", Dimension.LENGTH, 0.0, 1e-3, 0.0, role=Role.STRENGTH),
        Parameter("phase_2_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, 0.0, role=Role.PHASE),
        Parameter("amplitude_3_m", Dimension.LENGTH, 0.0, 1e-3, 0.0, role=Role.STRENGTH),
        Parameter("phase_3_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, 0.0, role=Role.PHASE),
    ),
    variants=(Variant(Stage.TRANSMISSION, _wobble),),
    text=Text(
        "The lead errs with the angle of the screw: by {amplitude_m} once, {amplitude_2_m} twice and "
        "{amplitude_3_m} three times per revolution.",
        Picture.LEAD_OVER_TURN,
    ),
    search=SearchHints(lambda s: [(0.5e-6, 0.0, 0.0, 0.0, 0.0, 0.0)], lambda a: (2e-6, 0.0)),
)
