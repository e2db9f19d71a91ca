"""Physics that the diagnosis has no name for, each against its equation."""

from __future__ import annotations

from math import exp, pi, sin

import numpy as np
import pytest
from sim_tools import outer_force_n, plant_with

from drivers.sim.axis import AxisTruth, one_mass, two_mass
from drivers.sim.contact import wander
from drivers.sim.effects import CATALOGUE, NOVEL, Effect

R = 0.01 / (2 * pi)
SLIDING_M_S = 0.1


def frictionless(**changes: float) -> AxisTruth:
    return two_mass(coulomb_torque_n_m=0.0, viscous_torque_n_m_s_rad=0.0, damping_ratio=0.0, **changes)


def test_the_library_has_none_of_it() -> None:
    assert not set(NOVEL) & set(CATALOGUE)
    assert all(name.startswith("novel_") for name in NOVEL)


@pytest.mark.parametrize("position_m", [0.1, 0.11, 0.2])
def test_tight_spot(position_m: float) -> None:
    bump = Effect("novel_friction_bump", {"fraction": 0.5, "centre_m": 0.1, "width_m": 0.01})
    axis = two_mass(viscous_torque_n_m_s_rad=0.0)
    expected = -1.1 / R * (1.0 + 0.5 * exp(-(((position_m - 0.1) / 0.01) ** 2) / 2))
    force = outer_force_n(plant_with(axis, bump), SLIDING_M_S, position_m=position_m)
    assert force == pytest.approx(expected, rel=1e-4)


def test_friction_wanders_with_an_rms_of_its_fraction() -> None:
    values = np.array([wander(t, 0.7) for t in np.linspace(0.0, 400.0, 8001)])
    assert np.sqrt(np.mean(values**2)) == pytest.approx(1.0, rel=0.02)
    assert np.max(np.abs(values)) < 2.84
    effect = Effect("novel_friction_wander", {"fraction": 0.2, "period_s": 1.0, "phase_rad": 0.7})
    plant = plant_with(two_mass(viscous_torque_n_m_s_rad=0.0), effect)
    force = outer_force_n(plant, SLIDING_M_S)
    assert force == pytest.approx(-1.1 / R * (1.0 + 0.2 * wander(plant.time_s, 0.7)), rel=1e-3)


@pytest.mark.parametrize("position_m", [0.05, 0.058, 0.2])
def test_dent_in_the_thread(position_m: float) -> None:
    effect = Effect("novel_pitch_bump", {"height_m": 8e-6, "centre_m": 0.05, "width_m": 0.008})
    plant = plant_with(two_mass(), effect)
    plant.reset(position_m)
    error = plant.table_true_m - R * plant.motor_true_rad
    assert error == pytest.approx(8e-6 * exp(-(((position_m - 0.05) / 0.008) ** 2) / 2), abs=1e-12)
    plant.advance(0.0, 0.05)  # at rest without a load: the slope is the derivative of the error
    assert plant.table_true_m - R * plant.motor_true_rad == pytest.approx(error, abs=1e-10)


def test_mass_of_the_table_changes() -> None:
    axis = one_mass(mass_kg=100.0, coulomb_force_n=0.0, viscous_force_n_s_m=0.0)
    plant = plant_with(axis, Effect("novel_mass_change", {"fraction": 0.25, "start_s": 0.1}))
    plant.advance(50.0, 0.1)
    before = plant.motor_velocity_true_rad_s
    plant.advance(50.0, 0.1)
    assert before == pytest.approx(0.05, rel=1e-3)
    assert plant.motor_velocity_true_rad_s - before == pytest.approx(0.04, rel=1e-3)


def test_vibration_and_hammering_push_the_table() -> None:
    vibration = {"force_n": 40.0, "frequency_hz": 7.0, "phase_rad": 0.3, "ratio": 0.5, "frequency_2_hz": 11.3}
    plant = plant_with(frictionless(), Effect("novel_vibration", vibration))
    force, time_s = outer_force_n(plant), plant.time_s - plant.step_s
    expected = 40.0 * (sin(2 * pi * 7.0 * time_s + 0.3) + 0.5 * sin(2 * pi * 11.3 * time_s))
    assert force == pytest.approx(expected, rel=1e-6)
    pulses = {"force_n": 80.0, "start_s": 0.01, "period_s": 0.02, "width_s": 0.005}
    plant = plant_with(frictionless(), Effect("novel_hammering", pulses), step_s=1e-3)
    seen = [outer_force_n(plant) > 40.0 for _ in range(25)]  # every second of 50 steps
    assert sum(seen) == pytest.approx(25 * 0.8 / 4, abs=1.5)
    assert not any(seen[:4])
