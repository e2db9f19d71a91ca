"""Nonlinear viscous friction: drag beyond linear in speed.

The deviation grows with the square of the speed or, for grease and oils that thin in shear, with its root.
"""

import math

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.mechanisms import stribeck_friction
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _quadratic_drag(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0] * at.velocity * abs(at.velocity)


@njit
def _thinning_drag(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    if at.viscous_speed <= 0.0:
        return value
    drag = max(parameters[0], 0.0) * at.viscous_speed**2 * math.sqrt(abs(at.velocity) / at.viscous_speed)
    return value + drag if at.velocity > 0.0 else value - drag


MECHANISM = Mechanism(
    id="nonlinear_viscous_friction",
    block=Block.MOTOR_SIDE,
    element="lubricant of nut and bearings",
    equation="F = Fc sign(v) + c v + q v |v|; thinning: + q v_r^2 sqrt(|v| / v_r) sign(v), q >= 0, v_r = Fc / c, "
    "which for q v_r^2 = 2 Fc is the law of Casson, |F| = (sqrt(Fc) + sqrt(c |v|))^2",
    source="Olsson et al., Friction models and friction compensation, European J. Control 4 (1998) 176; thinning: "
    "Casson, in Mill (ed.), Rheology of Disperse Systems (1959) 84",
    parameters=(Parameter("quadratic_n_m_s2_rad2", Dimension.MOTOR_DRAG, -1e5, 1e5, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.DRAG, _quadratic_drag),
        Variant(
            Stage.DRAG,
            _thinning_drag,
            "thinning lubricant",
            text=Text(
                "Drag rises steeply from rest and then ever less, with the root of the speed: at {viscous_speed} "
                "by {quadratic_n_m_s2_rad2} times the square of that speed."
            ),
            starts=lambda s: [(f * s.coulomb / s.viscous_speed**2,) for f in (0.1, 1.0)],
            proportional=False,
        ),
    ),
    text=Text(
        "Drag departs from linear in speed by {quadratic_n_m_s2_rad2} times the square of the speed.", Picture.FRICTION
    ),
    search=SearchHints(
        lambda s: [(0.05 * s.coulomb / s.peak_speed**2,)], lambda a: (0.2 * a.friction / (0.3 / a.ratio) ** 2,)
    ),
    corrects=lambda variant: "" if variant else stribeck_friction.MECHANISM.id,
)
