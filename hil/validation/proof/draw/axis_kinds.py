"""Draw the true parameters of each kind of axis, by the names of a bench file, and build the simulated axis."""

from collections.abc import Callable, Mapping
from math import exp, log, pi
from typing import Any, Literal

import numpy as np
from pydantic import TypeAdapter

from drivers.sim.axis import AxisTruth
from hil.bench.axis_models import Axis
from hil.bench.hardware import SimulationSection
from hil.loop.simulated_bench import true_axis

Rng = np.random.Generator
Kind = Literal["two_mass", "seven_dof", "serial_chain", "one_mass"]
KINDS: dict[Kind, float] = {"two_mass": 0.5, "seven_dof": 0.2, "serial_chain": 0.1, "one_mass": 0.2}  # shares
_SECTION: TypeAdapter[Axis] = TypeAdapter(Axis)
LEADS_M = (0.005, 0.010, 0.016, 0.020)


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform between two limits."""
    return exp(rng.uniform(log(low), log(high)))


def any_phase(rng: Rng) -> float:
    """Draw an angle [rad]."""
    return float(rng.uniform(-pi, pi))


def any_sign(rng: Rng) -> float:
    """Draw 1 or -1."""
    return float(rng.choice((-1.0, 1.0)))


def _two_mass(rng: Rng) -> dict[str, Any]:
    lead_m = float(rng.choice(LEADS_M))
    square = (lead_m / (2 * pi)) ** 2
    motor_kg = log_uniform(rng, 3e-4, 2e-3) / square
    table_kg = motor_kg * log_uniform(rng, 0.4, 2.0)
    omega = 2 * pi * log_uniform(rng, 55.0, 160.0)
    friction = _friction(rng, (motor_kg + table_kg) * square, lead_m)
    return {
        "lead_m": lead_m,
        "motor_mass_kg": motor_kg,
        "table_mass_kg": table_kg,
        "stiffness_n_m": omega**2 / (1 / motor_kg + 1 / table_kg),
        "damping_ratio": rng.uniform(0.015, 0.06),
        **friction,
    }


def _seven_dof(rng: Rng) -> dict[str, Any]:
    true = {
        "lead_m": float(rng.choice(LEADS_M)),
        "motor_inertia_kg_m2": 8.486e-4 * log_uniform(rng, 0.6, 1.8),
        "table_mass_kg": 58.8 * log_uniform(rng, 0.6, 4.0),
        "coupling_stiffness_n_m_rad": 1.10e4 * log_uniform(rng, 0.5, 2.0),
        "nut_support_stiffness_n_m": 6.53e7 * log_uniform(rng, 0.5, 2.0),
        "damping_ratio": rng.uniform(0.015, 0.06),
        "coulomb_torque_n_m": 1.0,
        "viscous_torque_n_m_s_rad": 0.0,
    }
    return true | _friction(rng, rigid_inertia(truth_of("seven_dof", true)), true["lead_m"])


def _serial_chain(rng: Rng) -> dict[str, Any]:
    lead_m = float(rng.choice(LEADS_M))
    motor = log_uniform(rng, 3e-4, 2e-3)
    inertias = (motor, motor * log_uniform(rng, 0.1, 0.4), motor * log_uniform(rng, 0.4, 2.0))
    nut = (2 * pi * log_uniform(rng, 60.0, 160.0)) ** 2 / (1 / (inertias[0] + inertias[1]) + 1 / inertias[2])
    return {
        "lead_m": lead_m,
        "inertias_kg_m2": inertias,
        "stiffnesses_n_m_rad": (nut * rng.uniform(2.0, 6.0), nut),
        "inertia_scale": 1.0,
        "stiffness_scale": 1.0,
        "damping_ratio": rng.uniform(0.015, 0.06),
        **_friction(rng, sum(inertias), lead_m),
    }


def _one_mass(rng: Rng) -> dict[str, Any]:
    mass_kg = log_uniform(rng, 30.0, 300.0)
    coulomb_n = mass_kg * log_uniform(rng, 0.2, 1.0)
    return {
        "mass_kg": mass_kg,
        "coulomb_force_n": coulomb_n,
        "viscous_force_n_s_m": coulomb_n * rng.uniform(0.4, 2.5) / 0.25,
        "screw_lead_m": float(rng.choice((0.0025, *LEADS_M))),
    }


def _friction(rng: Rng, inertia_kg_m2: float, lead_m: float) -> dict[str, float]:
    """Draw Coulomb friction as a share of the accelerating torque, and viscous friction equal to it near 0.25 m/s."""
    coulomb = inertia_kg_m2 / (lead_m / (2 * pi)) * log_uniform(rng, 0.5, 1.8)
    return {
        "coulomb_torque_n_m": coulomb,
        "viscous_torque_n_m_s_rad": coulomb * rng.uniform(0.3, 1.2) * lead_m / (2 * pi) / 0.25,
    }


def truth_of(kind: Kind, true: Mapping[str, Any]) -> AxisTruth:
    """Return the simulated axis with parameters by the names of a bench file."""
    return true_axis(_SECTION.validate_python({"model": kind, **true}), SimulationSection())


def rigid_inertia(truth: AxisTruth) -> float:
    """Return the inertia at the motor [kg m^2, kg] of the rigid axis, without the axial mass of the screw."""
    still = truth.mass_kg[truth.nut.axial] if truth.nut is not None and truth.nut.axial >= 0 else 0.0
    return float((sum(truth.mass_kg) - still) * truth.drive_ratio_m_rad**2)


PARAMETERS: dict[Kind, Callable[[Rng], dict[str, Any]]] = {
    "two_mass": _two_mass,
    "seven_dof": _seven_dof,
    "serial_chain": _serial_chain,
    "one_mass": _one_mass,
}
