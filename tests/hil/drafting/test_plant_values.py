"""Inertia and friction of a slow table from its recording, simulated by its own equations."""

import math

import numpy as np
import pytest

from hil.drafting.plant_values import plant_values
from hil.recording.recording import Recording

TURN_RAD, INERTIA_KG_M2, STEP_S = 1.2, 0.4, 1e-3


def moved(period_s: float, speeds_rad_s: tuple[float, ...]) -> Recording:
    """Moves there and back with friction that falls from rest (Stribeck) in a PI velocity loop."""
    parts = []
    for speed in speeds_rad_s:
        time = np.arange(round(2.0 * TURN_RAD / speed / STEP_S)) * STEP_S
        bell = 0.5 * speed * (time - TURN_RAD / speed / np.pi * np.sin(np.pi * time * speed / TURN_RAD))
        parts += [bell, np.full(1000, TURN_RAD), TURN_RAD - bell, np.zeros(1000)]
    command = np.concatenate(parts)
    ahead, rng = np.gradient(command, STEP_S), np.random.default_rng(62)
    position = velocity = integral = 0.0
    rows = []
    for wanted, feed in zip(command, ahead, strict=True):
        error = 8.0 * (wanted - position) + feed - velocity
        integral += error * STEP_S / 0.1
        torque = 12.0 * (error + integral)
        rows.append((position, torque + rng.normal(0.0, 0.02)))
        friction = 3.0 + 1.2 * math.exp(-((velocity / 0.05) ** 2))
        velocity += (torque - 0.8 * velocity) / INERTIA_KG_M2 * STEP_S
        loss = friction / INERTIA_KG_M2 * STEP_S
        velocity = math.copysign(max(abs(velocity) - loss, 0.0), velocity)
        position += velocity * STEP_S
    columns = np.array(rows)[:: round(period_s / STEP_S)].T
    return Recording("table", {"motor_position_rad": columns[0], "torque_n_m": columns[1]}, period_s)


def test_friction_near_a_reversal_is_neither_inertia_nor_gravity() -> None:
    """The torque of the inertia is a hundredth of the friction; at 20 Hz each reversal lies between two rows."""
    speeds = (0.12, 0.3, 0.17, 0.26, 0.22, 0.22, 0.27, 0.3, 0.32, 0.26)
    found = plant_values([moved(0.05, speeds)], 1.0)
    assert found.gravity is None
    assert found.inertia.value < INERTIA_KG_M2 + 2.0 * found.inertia.std_error
    assert found.coulomb.value == pytest.approx(3.0, rel=0.15)


def test_inertia_of_a_faster_table() -> None:
    found = plant_values([moved(0.002, (0.6, 1.2, 2.4))], 1.0)
    assert found.gravity is None
    assert found.inertia.value == pytest.approx(INERTIA_KG_M2, rel=0.02)
    assert found.left < 0.15  # 0.43 with the rows around reversals


def test_viscous_friction_that_a_stribeck_peak_hides_is_taken_from_constant_feeds() -> None:
    parts = []
    for speed in (3.0, 5.0, 2.0, 4.0):
        for direction in (1.0, -1.0):
            fast, slow = np.linspace(0.0, speed, 200), np.linspace(0.0, 0.3, 2000)
            parts += [direction * part for part in (fast, np.full(600, speed), fast[::-1], slow, slow[::-1])]
    velocity = np.concatenate(parts)
    position, acceleration = np.cumsum(velocity) * STEP_S, np.gradient(velocity, STEP_S)
    friction = np.sign(velocity) * (1.3 + 1.0 * np.exp(-((velocity / 0.12) ** 2))) + 0.09 * velocity
    torque = 0.08 * acceleration + friction + np.random.default_rng(1).normal(0.0, 0.02, velocity.size)
    columns = {"motor_position_rad": position, "torque_n_m": torque}
    told = {
        "time_s": np.arange(velocity.size) * STEP_S,
        "position_command_m": position,
        "velocity_command_m_s": velocity,
    }
    without, found = (plant_values([Recording("table", one, STEP_S)]) for one in (columns, columns | told))
    assert not without.viscous.significant
    assert found.viscous.value == pytest.approx(0.09, rel=0.05)
    assert found.coulomb.value == pytest.approx(1.3, rel=0.05)
    assert "constant feeds" in found.viscous.how
