"""Shared by the tests of the simulated reality: perfect sensors, forces measured by momentum, a test motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.sim.axis import AxisTruth
from drivers.sim.effects import Effect
from drivers.sim.plant import Plant
from drivers.sim.sensors import Sensors

PERFECT = Sensors(motor_counts_per_rev=0, table_resolution_m=0, torque_noise_n_m=0)
STEP_S = 1e-5


def plant_with(axis: AxisTruth, *effects: Effect, step_s: float = STEP_S) -> Plant:
    """The axis with perfect sensors and these effects."""
    return Plant(axis, PERFECT, effects, step_s=step_s)


def outer_force_n(
    plant: Plant, velocity_m_s: float = 0.0, torque_n_m: float = 0.0, position_m: float | None = None
) -> float:
    """Force of all that is not inside the chain, as its change of momentum over one step, all masses moving alike."""
    for _ in range(2):  # the first step acts with the mean of the old and the new torque
        if position_m is not None:
            plant.positions_m[:] = position_m
        plant.velocities_m_s[:] = velocity_m_s
        mass = plant.parameters["mass"][0, : plant.velocities_m_s.size]
        before = float(mass @ plant.velocities_m_s)
        plant.advance(torque_n_m, plant.step_s)
    return (float(mass @ plant.velocities_m_s) - before) / plant.step_s


def motion(duration_s: float = 2.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Set-points at 1 kHz, there and back by 30 mm with rests: smooth, with reversals and standstill."""
    time_s = np.arange(round(duration_s * 1000)) * 1e-3
    phase = np.clip(time_s - 0.1, 0.0, None) * 2 * np.pi / 0.8
    window = (time_s > 0.1) & (phase < 4 * np.pi)
    position = np.where(window, 0.015 * (1 - np.cos(phase)), 0.0)
    velocity = np.where(window, 0.015 * 2 * np.pi / 0.8 * np.sin(phase), 0.0)
    return position, velocity
