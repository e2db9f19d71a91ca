"""Draw effects of the library with values that an engineer would meet on an axis, in forms that the twin lacks too.

Lengths and speeds are those of the table; division by `ratio` converts them to the motor's unit. Torques are shares of
the axis's Coulomb friction or of the torque that the motion takes. Sources of the ranges: hil/twin/mechanisms.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt

from drivers.sim.effects import CATALOGUE, Effect
from hil.twin.library import BY_ID
from hil.twin.parameter import Role
from hil.validation.proof.draw.axes import DrawnAxis
from hil.validation.proof.draw.axis_kinds import Rng, any_phase, any_sign, log_uniform

FormAndParameters = tuple[str, dict[str, float]]
# Not drawn: what came after the first sealed proofs. The same seeds give the same cases.
NOT_DRAWN = (
    "end_stop", "friction_gradient", "load_dependent_friction", "local_friction", "periodic_force",
    "local_torque_constant", "table_side_viscous_friction", "torque_constant_drift", "torque_constant_gradient",
)  # fmt: skip
# drawn axes move a table: an effect of a load that turns is not among theirs
LIBRARY: tuple[str, ...] = tuple(name for name in CATALOGUE if not BY_ID[name].turning and name not in NOT_DRAWN)
NEED_TABLE = frozenset(name for name in LIBRARY if BY_ID[name].search.needs_table or BY_ID[name].in_transmission)
_SOFTEST = 0.8  # share of the stiffness that may be lost over the travel: the spring stays positive


@dataclass(frozen=True)
class DrawScale:
    """Scales of the draws: the axis, the peak torque of its motion without effects, the shortest recording."""

    axis: DrawnAxis
    peak_torque: float
    duration_s: float

    @property
    def ratio(self) -> float:
        """Table travel per unit of motor position."""
        return self.axis.truth.drive_ratio_m_rad

    @property
    def coulomb(self) -> float:
        """Coulomb friction [N m, N]."""
        return self.axis.coulomb


def applicable(axis: DrawnAxis) -> tuple[str, ...]:
    """Return the ids of the library's effects that this kind of axis can have and show."""
    return tuple(name for name in LIBRARY if axis.has_table or name not in NEED_TABLE)


def draw_effect(name: str, scale: DrawScale, rng: Rng) -> Effect:
    """Draw an effect of the library with random form and parameters for this axis."""
    form, parameters = _WITH_FORM[name](scale, rng) if name in _WITH_FORM else ("", _PLAIN[name](scale, rng))
    return Effect(name, {key: float(value) for key, value in parameters.items()}, form)


def scaled(effect: Effect, factor: float, scale: DrawScale) -> Effect | None:
    """Return the effect with its strength times a factor; None if that leaves the allowed range."""
    parameters = dict(effect.parameters)
    if effect.id == "stribeck_friction":
        rise = parameters["static_torque_n_m"] - scale.coulomb
        parameters["static_torque_n_m"] = scale.coulomb + factor * rise
    elif effect.id == "presliding_hysteresis":
        parameters["stiffness_n_m_rad"] /= factor
    elif effect.id == "torque_saturation":
        parameters["limit_n_m"] = scale.peak_torque - factor * (scale.peak_torque - parameters["limit_n_m"])
    else:
        for index in BY_ID[effect.id].indices(Role.STRENGTH):
            parameters[BY_ID[effect.id].names[index]] *= factor
    if parameters.get("relative_slope", 0.0) * scale.axis.travel_m < -_SOFTEST:
        return None
    try:
        return Effect(effect.id, parameters, effect.form)
    except ValueError:
        return None


def _drive_form(rng: Rng) -> str:
    return str(rng.choice(("visible", "hidden")))


def _structural_mode(s: DrawScale, rng: Rng) -> FormAndParameters:
    """Draw an attached mass, or a base in the same ranges of the equivalent mass.

    A base acts on the drive like a mass on the table of mass ratio 1 / mu and frequency f sqrt(mu / (1 + mu)).
    """
    frequency_hz, ratio = log_uniform(rng, 15.0, 120.0), log_uniform(rng, 0.05, 0.5)
    damping = rng.uniform(0.01, 0.05)
    base = not rng.random() < 0.5
    return "base" if base else "attached", {
        "frequency_hz": frequency_hz * sqrt(1.0 + ratio) if base else frequency_hz,
        "mass_ratio": 1.0 / ratio if base else ratio,
        "damping_ratio": damping,
    }


def _external_force(s: DrawScale, rng: Rng) -> dict[str, float]:
    start_s = s.duration_s * rng.uniform(0.15, 0.6)
    return {
        "force_n": any_sign(rng) * s.coulomb / s.ratio * log_uniform(rng, 0.1, 1.0),
        "start_s": start_s,
        "end_s": start_s + s.duration_s * rng.uniform(0.05, 0.3),
    }


def _periodic_lead_error(s: DrawScale, rng: Rng) -> dict[str, float]:
    """Draw harmonics as measured on screws: the first dominates, the others are a few tenths of it."""
    amplitude_m = log_uniform(rng, 1e-6, 15e-6)
    return {
        "amplitude_m": amplitude_m,
        "phase_rad": any_phase(rng),
        "amplitude_2_m": amplitude_m * rng.uniform(0.0, 0.3),
        "phase_2_rad": any_phase(rng),
        "amplitude_3_m": amplitude_m * rng.uniform(0.0, 0.15),
        "phase_3_rad": any_phase(rng),
    }


def _channel_time_skew(s: DrawScale, rng: Rng) -> FormAndParameters:
    forms = ("table_position", "motor_position", "torque") if s.axis.has_table else ("motor_position", "torque")
    form = str(rng.choice(forms))
    # a late position is off by the distance travelled meanwhile: some 10 us are visible
    return form, {"delay_s": log_uniform(rng, 0.1e-3 if form == "torque" else 10e-6, 2e-3)}


_PLAIN: Mapping[str, Callable[[DrawScale, Rng], dict[str, float]]] = {
    "asymmetric_friction": lambda s, rng: {
        "offset_torque_n_m": any_sign(rng) * s.coulomb * log_uniform(rng, 0.03, 0.4)
    },
    "constant_load": lambda s, rng: {"load_torque_n_m": any_sign(rng) * s.coulomb * log_uniform(rng, 0.03, 1.0)},
    "position_dependent_friction": lambda s, rng: {
        "fraction": log_uniform(rng, 0.05, 0.5),
        "phase_rad": any_phase(rng),
        "period_m": log_uniform(rng, 0.02, 0.8 * s.axis.travel_m),
    },
    "nonlinear_viscous_friction": lambda s, rng: {
        "quadratic_n_m_s2_rad2": s.coulomb * log_uniform(rng, 0.1, 1.5) / (s.axis.feed_m_s / s.ratio) ** 2
    },
    "friction_drift": lambda s, rng: {
        "fraction": any_sign(rng) * log_uniform(rng, 0.08, 0.6),
        "time_constant_s": log_uniform(rng, 2.0, 20.0),
    },
    "cogging_torque": lambda s, rng: {
        "amplitude_n_m": s.coulomb * log_uniform(rng, 0.02, 0.3),
        "phase_rad": any_phase(rng),
        "cycles_per_rev": rng.choice((4, 6, 8, 12, 18, 24, 36)),
    },
    "table_side_friction": lambda s, rng: {"share": rng.uniform(0.15, 0.9)},
    "external_force": _external_force,
    "spring_load": lambda s, rng: {
        "stiffness_n_m": s.coulomb / s.ratio * log_uniform(rng, 0.1, 2.0) / s.axis.travel_m,
        "rest_position_m": s.axis.travel_m * rng.uniform(-0.5, 1.5),
    },
    "backlash": lambda s, rng: {"gap_m": log_uniform(rng, 2e-6, 60e-6)},
    "preload_loss": lambda s, rng: {"zone_m": log_uniform(rng, 2e-6, 40e-6), "stiffness_ratio": rng.uniform(0.1, 0.7)},
    "position_dependent_stiffness": lambda s, rng: {
        "relative_slope": rng.uniform(0.4, 3.0) if rng.random() < 0.5 else -rng.uniform(0.3, 0.7) / s.axis.travel_m
    },
    "periodic_lead_error": _periodic_lead_error,
    "cumulative_lead_error": lambda s, rng: {"slope_m_m": any_sign(rng) * log_uniform(rng, 5e-6, 200e-6)},
    "thermal_growth": lambda s, rng: {
        "relative_growth": log_uniform(rng, 10e-6, 200e-6),
        "time_constant_s": log_uniform(rng, 2.0, 30.0),
    },
    "torque_ripple": lambda s, rng: {
        "fraction": log_uniform(rng, 0.01, 0.12),
        "cycles_per_rev": rng.choice((2, 4, 6, 8, 12, 24)),
        "phase_rad": any_phase(rng),
    },
    "torque_constant_saturation": lambda s, rng: {
        "coefficient_1_n2_m2": log_uniform(rng, 0.03, 0.25) / s.peak_torque**2
    },
    "velocity_filter_lag": lambda s, rng: {"time_constant_s": log_uniform(rng, 0.3e-3, 2e-3)},
    "encoder_eccentricity": lambda s, rng: {
        "amplitude_rad": log_uniform(rng, 0.3e-6, 6e-6) / s.ratio,
        "phase_rad": any_phase(rng),
    },
    "scale_interpolation_error": lambda s, rng: {
        "amplitude_m": log_uniform(rng, 0.1e-6, 2e-6),
        "phase_rad": any_phase(rng),
        "period_m": rng.choice((4e-6, 10e-6, 20e-6, 40e-6, 100e-6, 200e-6)),
    },
}
_WITH_FORM: Mapping[str, Callable[[DrawScale, Rng], FormAndParameters]] = {
    "stribeck_friction": lambda s, rng: (
        str(rng.choice(("gaussian", "exponential", "atan"), p=(0.4, 0.3, 0.3))),
        {
            "static_torque_n_m": s.coulomb * rng.uniform(1.2, 2.2),
            "stribeck_velocity_rad_s": log_uniform(rng, 1e-3, 15e-3) / s.ratio,
        },
    ),
    "presliding_hysteresis": lambda s, rng: (
        str(rng.choice(("gms", "dahl", "lugre"), p=(0.4, 0.4, 0.2))),
        {"stiffness_n_m_rad": s.coulomb * s.ratio / log_uniform(rng, 0.5e-6, 20e-6)},
    ),
    "structural_mode": _structural_mode,
    "torque_saturation": lambda s, rng: (_drive_form(rng), {"limit_n_m": s.peak_torque * rng.uniform(0.6, 0.95)}),
    "torque_dead_zone": lambda s, rng: (
        _drive_form(rng),
        {"half_width_n_m": s.coulomb * log_uniform(rng, 0.02, 0.3)},
    ),
    "current_loop_lag": lambda s, rng: (_drive_form(rng), {"time_constant_s": log_uniform(rng, 0.2e-3, 2e-3)}),
    "transport_delay": lambda s, rng: (_drive_form(rng), {"delay_s": log_uniform(rng, 0.3e-3, 2e-3)}),
    "channel_time_skew": _channel_time_skew,
}
