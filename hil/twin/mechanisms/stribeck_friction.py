"""Stribeck friction: friction falls with speed from its static value.

How it falls differs from contact to contact: the variants are the laws in use.
"""

import math
from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import PARAMETERS, Block, Dimension, Mechanism, Moment, Parameter, Picture, Role, Stage, Variant
from hil.twin.scene import AxisFacts


@njit
def _stribeck_level(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    static, stribeck_velocity = parameters[0], parameters[1]
    if stribeck_velocity <= 0.0:
        return value
    u = abs(at.velocity) / stribeck_velocity
    variant = parameters[PARAMETERS - 1]
    if variant == 1.0:
        share = math.exp(-u)
    elif variant == 2.0:
        share = 1.0 / (1.0 + u * u)
    else:
        share = math.exp(-u * u)
    return value + (static - value) * share


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that static friction is above Coulomb friction."""
    return values[0] > axis.coulomb


MECHANISM = Mechanism(
    id="stribeck_friction",
    block=Block.MOTOR_SIDE,
    element="ball nut and guideways",
    sentence="Friction falls from {static_torque_n_m} at rest as speed passes {stribeck_velocity_rad_s}.",
    equation="F(v) = Fc + (Fs - Fc) s(v/vs); s(u) = exp(-u^2), exp(-u) or 1/(1 + u^2)",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083: Gaussian; Tustin (1947): "
    "exponential; Hess and Soom (1990): Lorentzian",
    parameters=(
        Parameter("static_torque_n_m", Dimension.TORQUE, 0.0, 1e4, role=Role.STRENGTH),
        Parameter("stribeck_velocity_rad_s", Dimension.MOTOR_SPEED, 1e-5, 1e3),
    ),
    variants=(
        Variant(Stage.COULOMB, _stribeck_level, "Gaussian"),
        Variant(Stage.COULOMB, _stribeck_level, "exponential"),
        Variant(Stage.COULOMB, _stribeck_level, "Lorentzian"),
    ),
    starts=lambda s: [(1.3 * s.coulomb, f * s.peak_speed) for f in (0.003, 0.01, 0.04)],
    typical=lambda a: (1.5 * a.friction, 2e-3 / a.ratio),
    valid=_valid,
    proportional=False,
    picture=Picture.FRICTION,
    neutral_at_zero=False,
)
