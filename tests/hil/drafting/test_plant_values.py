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
    found = plant_values(moved(0.05, speeds), 1.0)
    assert found.gravity is None
    assert found.inertia.value < INERTIA_KG_M2 + 2.0 * found.inertia.std_error
    usual = 0.2  # rad/s; a line through friction that falls from rest has another intercept
    assert found.coulomb.value + usual * found.viscous.value == pytest.approx(3.0 + 0.8 * usual, rel=0.02)


def test_inertia_of_a_faster_table() -> None:
    found = plant_values(moved(0.002, (0.6, 1.2, 2.4)), 1.0)
    assert found.gravity is None
    assert found.inertia.value == pytest.approx(INERTIA_KG_M2, rel=0.02)
    assert found.left < 0.15  # 0.43 with the rows around reversals


def test_a_torque_that_is_a_mean_over_the_coming_tick_leaves_viscous_friction_right() -> None:
    """It is half a row early: with the inertia that would take from it. Gravity is filtered like the rest."""
    tones = ((0.9, 1.0, 0.0), (0.4, 2.5, 1.0), (0.2, 17.0, 2.0))
    time_s = np.arange(12_000) * 2e-3
    angle = sum(size * np.sin(w * time_s + p) for size, w, p in tones)
    later = np.arange(12_001 * 20) * 1e-4
    moved_later = sum(
        size * np.sin(w * later + p) for size, w, p in ((0.9, 1.0, 0.0), (0.4, 2.5, 1.0), (0.2, 17.0, 2.0))
    )
    speed = np.gradient(moved_later, 1e-4)
    torque = 0.4 * np.gradient(speed, 1e-4) + 0.3 * speed + 1.0 * np.sign(speed) + 5.0 * np.sin(moved_later)
    mean = torque[: 12_000 * 20].reshape(-1, 20).mean(axis=1)
    noise = np.random.default_rng(3).normal(0.0, 0.02, mean.size)
    found = plant_values(Recording("arm", {"motor_position_rad": angle, "torque_n_m": mean + noise}, 2e-3), 1.0)
    assert found.gravity is not None
    for estimate, truth in ((found.inertia, 0.4), (found.viscous, 0.3), (found.coulomb, 1.0), (found.gravity, 5.0)):
        assert abs(estimate.value - truth) < 3.0 * estimate.std_error + 2e-3 * truth
