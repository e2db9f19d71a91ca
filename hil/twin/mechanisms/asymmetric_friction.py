"""Asymmetric friction: friction differs by direction, by a constant torque or in proportion to speed."""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.mechanisms import constant_load
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts


@njit
def _offset(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0]


@njit
def _offset_with_speed(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    if at.viscous_speed <= 0.0:
        return value
    return value + parameters[0] * abs(at.velocity) / at.viscous_speed


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that a constant offset is below Coulomb friction: above, it would drive the axis."""
    return variant != 0 or abs(values[0]) <= axis.coulomb


MECHANISM = Mechanism(
    id="asymmetric_friction",
    block=Block.MOTOR_SIDE,
    element="ball nut, seals and guideways",
    equation="T_f = Fc sign(v) + T_0; at rest T_0 - Fc <= T_f <= T_0 + Fc; with speed: T_0 |v| / v_r, v_r = Fc / c",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083, direction dependence; its "
    "slope over speed differs by direction too: Armstrong-Hélouvry, Control of Machines with Friction (1991)",
    parameters=(Parameter("offset_torque_n_m", Dimension.TORQUE, -1e3, 1e3, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.BIAS, _offset),
        Variant(
            Stage.DRAG,
            _offset_with_speed,
            "with speed",
            text=Text(
                "Friction differs by direction, the more the faster: at {viscous_speed}, where viscous friction "
                "equals Coulomb friction, it is {offset_torque_n_m} above the mean of both in positive direction.",
                reversed="Friction differs by direction, the more the faster: at {viscous_speed}, where viscous "
                "friction equals Coulomb friction, it is {offset_torque_n_m} below the mean of both in positive "
                "direction.",
            ),
        ),
    ),
    text=Text(
        "Friction in positive direction is {offset_torque_n_m} above the mean of both directions.",
        Picture.FRICTION,
        reversed="Friction in positive direction is {offset_torque_n_m} below the mean of both directions.",
    ),
    search=SearchHints(typical=lambda a: (0.1 * a.friction,)),
    can_be=_valid,
    same_torque=lambda variant: "" if variant else constant_load.MECHANISM.id,
)
