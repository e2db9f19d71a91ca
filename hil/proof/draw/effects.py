"""Effects drawn at random: values that an engineer would meet on this axis, in forms that the twin has not.

Lengths and speeds are those of the table; `_angle` and `_rad_s` turn them into the motor's unit. Torques are shares of
the axis's Coulomb friction or of the torque that the motion takes. Sources of the ranges: the mechanisms of
hil/twin/mechanisms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt

from drivers.sim.effects import CATALOGUE, Effect
from hil.proof.draw.axes import DrawnAxis
from hil.proof.draw.random_draws import Rng, any_phase, any_sign, log_uniform

Drawn = tuple[str, dict[str, float]]  # form and parameters
NEED_TABLE = frozenset(
    {
        "backlash",
        "preload_loss",
        "position_dependent_stiffness",
        "periodic_lead_error",
        "cumulative_lead_error",
        "thermal_growth",
        "scale_interpolation_error",
        "structural_mode",
        "table_side_friction",
    }
)

# The parameter that says how strong an effect is, where one does.
STRENGTH: Mapping[str, str] = {
    "asymmetric_friction": "offset_torque_n_m",
    "constant_load": "load_torque_n_m",
    "position_dependent_friction": "fraction",
    "nonlinear_viscous_friction": "quadratic_n_m_s2_rad2",
    "friction_drift": "fraction",
    "table_side_friction": "share",
    "backlash": "gap_m",
    "preload_loss": "zone_m",
    "position_dependent_stiffness": "relative_slope",
    "cumulative_lead_error": "slope_m_m",
    "thermal_growth": "relative_growth",
    "structural_mode": "mass_ratio",
    "torque_ripple": "fraction",
    "torque_constant_saturation": "coefficient_1_n2_m2",
    "torque_dead_zone": "half_width_n_m",
    "current_loop_lag": "time_constant_s",
    "transport_delay": "delay_s",
    "velocity_filter_lag": "time_constant_s",
    "channel_time_skew": "delay_s",
    "external_force": "force_n",
    "spring_load": "stiffness_n_m",
}
_SOFTEST = 0.8  # share of the stiffness that may be lost over the travel


@dataclass(frozen=True)
class Scene:
    """What the draws are scaled by: the axis, the torque its motion takes without effects, the shortest recording."""

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
    """Ids of the library's effects that this kind of axis can have and show."""
    return tuple(name for name in LIBRARY if axis.has_table or name not in NEED_TABLE)


def draw_effect(name: str, scene: Scene, rng: Rng) -> Effect:
    """An effect of the library with random form and parameters for this axis."""
    form, parameters = _DRAWS[name](scene, rng)
    return Effect(name, {key: float(value) for key, value in parameters.items()}, form)


def scaled(effect: Effect, factor: float, scene: Scene) -> Effect | None:
    """The effect with its strength times a factor; None where that is no longer possible."""
    parameters = dict(effect.parameters)
    if effect.id == "stribeck_friction":
        rise = parameters["static_torque_n_m"] - scene.coulomb
        parameters["static_torque_n_m"] = scene.coulomb + factor * rise
    elif effect.id == "presliding_hysteresis":
        parameters["stiffness_n_m_rad"] /= factor
    elif effect.id == "torque_saturation":
        parameters["limit_n_m"] = scene.peak_torque - factor * (scene.peak_torque - parameters["limit_n_m"])
    else:
        for name in [name for name in parameters if name.startswith("amplitude")] or [STRENGTH[effect.id]]:
            parameters[name] *= factor
    if parameters.get("relative_slope", 0.0) * scene.axis.travel_m < -_SOFTEST:
        return None
    try:
        return Effect(effect.id, parameters, effect.form)
    except ValueError:
        return None


def _drive_form(rng: Rng) -> str:
    return str(rng.choice(("visible", "hidden")))


def _asymmetric_friction(s: Scene, rng: Rng) -> Drawn:
    return "", {"offset_torque_n_m": any_sign(rng) * s.coulomb * log_uniform(rng, 0.03, 0.4)}


def _constant_load(s: Scene, rng: Rng) -> Drawn:
    return "", {"load_torque_n_m": any_sign(rng) * s.coulomb * log_uniform(rng, 0.03, 1.0)}


def _stribeck_friction(s: Scene, rng: Rng) -> Drawn:
    form = str(rng.choice(("gaussian", "exponential", "atan"), p=(0.4, 0.3, 0.3)))
    return form, {
        "static_torque_n_m": s.coulomb * rng.uniform(1.2, 2.2),
        "stribeck_velocity_rad_s": log_uniform(rng, 1e-3, 15e-3) / s.ratio,
    }


def _presliding_hysteresis(s: Scene, rng: Rng) -> Drawn:
    form = str(rng.choice(("gms", "dahl", "lugre"), p=(0.4, 0.4, 0.2)))
    return form, {"stiffness_n_m_rad": s.coulomb * s.ratio / log_uniform(rng, 0.5e-6, 20e-6)}


def _position_dependent_friction(s: Scene, rng: Rng) -> Drawn:
    return "", {
        "fraction": log_uniform(rng, 0.05, 0.5),
        "phase_rad": any_phase(rng),
        "period_m": log_uniform(rng, 0.02, 0.8 * s.axis.travel_m),
    }


def _nonlinear_viscous_friction(s: Scene, rng: Rng) -> Drawn:
    return "", {"quadratic_n_m_s2_rad2": s.coulomb * log_uniform(rng, 0.1, 1.5) / (s.axis.feed_m_s / s.ratio) ** 2}


def _friction_drift(s: Scene, rng: Rng) -> Drawn:
    return "", {"fraction": any_sign(rng) * log_uniform(rng, 0.08, 0.6), "time_constant_s": log_uniform(rng, 2.0, 20.0)}


def _cogging_torque(s: Scene, rng: Rng) -> Drawn:
    return "", {
        "amplitude_n_m": s.coulomb * log_uniform(rng, 0.02, 0.3),
        "phase_rad": any_phase(rng),
        "cycles_per_rev": rng.choice((4, 6, 8, 12, 18, 24, 36)),
    }


def _table_side_friction(s: Scene, rng: Rng) -> Drawn:
    return "", {"share": rng.uniform(0.15, 0.9)}


def _structural_mode(s: Scene, rng: Rng) -> Drawn:
    """A base that yields acts on the drive like a mass on the table of mass ratio 1 / mu and of the frequency
    f sqrt(mu / (1 + mu)): mu and f are drawn such that these lie in the ranges of an attached mass."""
    frequency_hz, ratio = log_uniform(rng, 15.0, 120.0), log_uniform(rng, 0.05, 0.5)
    damping = rng.uniform(0.01, 0.05)
    if rng.random() < 0.5:
        return "attached", {"frequency_hz": frequency_hz, "mass_ratio": ratio, "damping_ratio": damping}
    return "base", {
        "frequency_hz": frequency_hz * sqrt(1.0 + ratio),
        "mass_ratio": 1.0 / ratio,
        "damping_ratio": damping,
    }


def _external_force(s: Scene, rng: Rng) -> Drawn:
    start_s = s.duration_s * rng.uniform(0.15, 0.6)
    return "", {
        "force_n": any_sign(rng) * s.coulomb / s.ratio * log_uniform(rng, 0.1, 1.0),
        "start_s": start_s,
        "end_s": start_s + s.duration_s * rng.uniform(0.05, 0.3),
    }


def _spring_load(s: Scene, rng: Rng) -> Drawn:
    travel = s.axis.travel_m
    return "", {
        "stiffness_n_m": s.coulomb / s.ratio * log_uniform(rng, 0.1, 2.0) / travel,
        "rest_position_m": travel * rng.uniform(-0.5, 1.5),
    }


def _backlash(s: Scene, rng: Rng) -> Drawn:
    return "", {"gap_m": log_uniform(rng, 2e-6, 60e-6)}


def _preload_loss(s: Scene, rng: Rng) -> Drawn:
    return "", {"zone_m": log_uniform(rng, 2e-6, 40e-6), "stiffness_ratio": rng.uniform(0.1, 0.7)}


def _position_dependent_stiffness(s: Scene, rng: Rng) -> Drawn:
    return "", {
        "relative_slope": (rng.uniform(0.4, 3.0) if rng.random() < 0.5 else -rng.uniform(0.3, 0.7) / s.axis.travel_m)
    }


def _periodic_lead_error(s: Scene, rng: Rng) -> Drawn:
    """As measured on screws: once per revolution dominates, harmonics of a few tenths of it."""
    amplitude_m = log_uniform(rng, 1e-6, 15e-6)
    return "", {
        "amplitude_m": amplitude_m,
        "phase_rad": any_phase(rng),
        "amplitude_2_m": amplitude_m * rng.uniform(0.0, 0.3),
        "phase_2_rad": any_phase(rng),
        "amplitude_3_m": amplitude_m * rng.uniform(0.0, 0.15),
        "phase_3_rad": any_phase(rng),
    }


def _cumulative_lead_error(s: Scene, rng: Rng) -> Drawn:
    return "", {"slope_m_m": any_sign(rng) * log_uniform(rng, 5e-6, 200e-6)}


def _thermal_growth(s: Scene, rng: Rng) -> Drawn:
    return "", {"relative_growth": log_uniform(rng, 10e-6, 200e-6), "time_constant_s": log_uniform(rng, 2.0, 30.0)}


def _torque_ripple(s: Scene, rng: Rng) -> Drawn:
    return "", {
        "fraction": log_uniform(rng, 0.01, 0.12),
        "cycles_per_rev": rng.choice((2, 4, 6, 8, 12, 24)),
        "phase_rad": any_phase(rng),
    }


def _torque_constant_saturation(s: Scene, rng: Rng) -> Drawn:
    return "", {"coefficient_1_n2_m2": log_uniform(rng, 0.03, 0.25) / s.peak_torque**2}


def _torque_saturation(s: Scene, rng: Rng) -> Drawn:
    return _drive_form(rng), {"limit_n_m": s.peak_torque * rng.uniform(0.6, 0.95)}


def _torque_dead_zone(s: Scene, rng: Rng) -> Drawn:
    return _drive_form(rng), {"half_width_n_m": s.coulomb * log_uniform(rng, 0.02, 0.3)}


def _current_loop_lag(s: Scene, rng: Rng) -> Drawn:
    return _drive_form(rng), {"time_constant_s": log_uniform(rng, 0.2e-3, 2e-3)}


def _transport_delay(s: Scene, rng: Rng) -> Drawn:
    return _drive_form(rng), {"delay_s": log_uniform(rng, 0.3e-3, 2e-3)}


def _velocity_filter_lag(s: Scene, rng: Rng) -> Drawn:
    return "", {"time_constant_s": log_uniform(rng, 0.3e-3, 2e-3)}


def _channel_time_skew(s: Scene, rng: Rng) -> Drawn:
    forms = ("table_position", "motor_position", "torque") if s.axis.has_table else ("motor_position", "torque")
    form = str(rng.choice(forms))
    # a position is seen to be late by the distance that the table goes meanwhile: some 10 us show
    return form, {"delay_s": log_uniform(rng, 0.1e-3 if form == "torque" else 10e-6, 2e-3)}


def _encoder_eccentricity(s: Scene, rng: Rng) -> Drawn:
    return "", {"amplitude_rad": log_uniform(rng, 0.3e-6, 6e-6) / s.ratio, "phase_rad": any_phase(rng)}


def _scale_interpolation_error(s: Scene, rng: Rng) -> Drawn:
    return "", {
        "amplitude_m": log_uniform(rng, 0.1e-6, 2e-6),
        "phase_rad": any_phase(rng),
        "period_m": rng.choice((4e-6, 10e-6, 20e-6, 40e-6, 100e-6, 200e-6)),
    }


_DRAWS: Mapping[str, Callable[[Scene, Rng], Drawn]] = {
    function.__name__[1:]: function
    for function in (
        _asymmetric_friction,
        _constant_load,
        _stribeck_friction,
        _presliding_hysteresis,
        _position_dependent_friction,
        _nonlinear_viscous_friction,
        _friction_drift,
        _table_side_friction,
        _backlash,
        _preload_loss,
        _position_dependent_stiffness,
        _periodic_lead_error,
        _cumulative_lead_error,
        _thermal_growth,
        _structural_mode,
        _cogging_torque,
        _torque_ripple,
        _torque_constant_saturation,
        _torque_saturation,
        _torque_dead_zone,
        _current_loop_lag,
        _transport_delay,
        _velocity_filter_lag,
        _channel_time_skew,
        _encoder_eccentricity,
        _scale_interpolation_error,
        _external_force,
        _spring_load,
    )
}
LIBRARY: tuple[str, ...] = tuple(name for name in CATALOGUE if name in _DRAWS)
