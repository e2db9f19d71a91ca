"""Stribeck friction: friction falls with speed from its static value.

The law differs between contacts: the variants are those in use.
"""

import math
from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts


@njit
def _gaussian(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    if parameters[1] <= 0.0:
        return value
    u = at.velocity / parameters[1]
    return value + (parameters[0] - value) * math.exp(-u * u)


@njit
def _exponential(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    if parameters[1] <= 0.0:
        return value
    return value + (parameters[0] - value) * math.exp(-abs(at.velocity) / parameters[1])


@njit
def _lorentzian(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    if parameters[1] <= 0.0:
        return value
    u = at.velocity / parameters[1]
    return value + (parameters[0] - value) / (1.0 + u * u)


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that static friction is above Coulomb friction."""
    return values[0] > axis.coulomb


MECHANISM = Mechanism(
    id="stribeck_friction",
    block=Block.MOTOR_SIDE,
    element="ball nut and guideways",
    equation="F(v) = Fc + (Fs - Fc) s(v/vs); s(u) = exp(-u^2), exp(-u) or 1/(1 + u^2)",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083: Gaussian; Tustin (1947): "
    "exponential; Hess and Soom (1990): Lorentzian",
    parameters=(
        Parameter("static_torque_n_m", Dimension.TORQUE, 0.0, 1e4, role=Role.STRENGTH),
        Parameter("stribeck_velocity_rad_s", Dimension.MOTOR_SPEED, 1e-5, 1e3),
    ),
    variants=(
        Variant(Stage.COULOMB, _gaussian, "Gaussian"),
        Variant(Stage.COULOMB, _exponential, "exponential"),
        Variant(Stage.COULOMB, _lorentzian, "Lorentzian"),
    ),
    text=Text(
        "Friction falls from {static_torque_n_m} at rest as speed passes {stribeck_velocity_rad_s}.", Picture.FRICTION
    ),
    search=SearchHints(
        lambda s: [(1.3 * s.coulomb, f * s.peak_speed) for f in (0.003, 0.01, 0.04, 0.13)],
        lambda a: (1.5 * a.friction, 2e-3 / a.ratio),
        proportional=False,
    ),
    can_be=_valid,
    neutral=lambda a: a.coulomb,
)
