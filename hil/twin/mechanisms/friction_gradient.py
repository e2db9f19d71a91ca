"""Friction gradient: friction rises or falls steadily along the travel.

A guide out of line, a cover or a cable that is dragged along, or a nut that wears on one end.
"""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _rising_level(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value * max(1.0 + parameters[0] * at.table_position_m, 0.0)


MECHANISM = Mechanism(
    id="friction_gradient",
    block=Block.MOTOR_SIDE,
    element="guideways, covers or ball screw",
    equation="F = Fc (1 + s x)",
    source="Armstrong-Hélouvry, Control of Machines with Friction (1991), position-dependent friction",
    parameters=(Parameter("slope_1_m", Dimension.PER_LENGTH, -20.0, 20.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.COULOMB, _rising_level),),
    text=Text(
        "Friction changes along the travel by {slope_1_m}, as a share of its level at position zero.",
        Picture.FRICTION_OVER_TRAVEL,
    ),
)
