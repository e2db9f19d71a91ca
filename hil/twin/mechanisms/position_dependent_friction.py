"""Position-dependent friction: friction varies along the travel."""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import ANYWHERE, Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _level_along_travel(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    fraction, period_m, phase_rad = parameters[0], parameters[1], parameters[2]
    if period_m <= 0.0:
        return value
    return value * (1.0 + fraction * math.sin(2.0 * math.pi * at.table_position_m / period_m + phase_rad))


MECHANISM = Mechanism(
    id="position_dependent_friction",
    block=Block.MOTOR_SIDE,
    element="ball nut and screw",
    equation="F = Fc (1 + a sin(2 pi x / p + phi))",
    source="Armstrong-Hélouvry, Control of Machines with Friction (1991), position-dependent friction",
    parameters=(
        Parameter("fraction", Dimension.RATIO, 0.0, 1.0, role=Role.STRENGTH),
        Parameter("period_m", Dimension.LENGTH, 1e-4, ANYWHERE, role=Role.PERIOD),
        Parameter("phase_rad", Dimension.ANGLE, -2.0 * math.pi, 2.0 * math.pi, role=Role.PHASE),
    ),
    variants=(Variant(Stage.COULOMB, _level_along_travel),),
    text=Text(
        "Friction varies by a share of {fraction} along the travel, with a period of {period_m}.",
        Picture.FRICTION_OVER_TRAVEL,
    ),
    search=SearchHints(typical=lambda a: (0.1, 0.1, 0.0), screw_locked=True),
    most=2,
)
