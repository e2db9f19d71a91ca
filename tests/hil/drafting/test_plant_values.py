"""Inertia and friction of a slow table from its recording, simulated by its own equations."""

import math

import numpy as np
import pytest

from hil.drafting.plant_values import plant_values
from hil.errors import InputError
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
    assert abs(found.coulomb.value - 3.0) < 2.0 * found.coulomb.std_error < 1.5


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


def constant(speed: float, seed: int) -> Recording:
    """Rows of 0.1 s at one speed: 0.05 N m s/rad, 0.8 N m, a load of 0.1 N m."""
    time = np.arange(80) * 0.1
    torque = 0.05 * speed + 0.8 * np.sign(speed) + 0.1 + np.random.default_rng(seed).normal(0.0, 0.02, time.size)
    columns = {"time_s": time, "motor_position_rad": speed * time, "torque_n_m": torque}
    return Recording(f"at {speed:g}", columns, 0.1)


def test_recordings_of_one_speed_each_are_one_axis() -> None:
    speeds = (2.0, 4.0, 8.0, 12.0, -2.0, -4.0, -8.0, -12.0)
    found = plant_values([constant(speed, seed) for seed, speed in enumerate(speeds)])
    for estimate, value in ((found.viscous, 0.05), (found.coulomb, 0.8), (found.offset, 0.1)):
        assert abs(estimate.value - value) < 3.0 * estimate.std_error < 0.2 * max(value, 0.3)
    assert not found.inertia.significant


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_motion_one_way_tells_inertia_and_the_sum_of_friction_and_load(way: float) -> None:
    time = np.arange(8000) * STEP_S
    velocity, acceleration = way * (6.0 + 3.0 * np.sin(2.0 * time)), way * 6.0 * np.cos(2.0 * time)
    torque = 0.02 * acceleration + 0.05 * velocity + way * 0.8 + 0.1
    torque += np.random.default_rng(3).normal(0.0, 0.01, time.size)
    columns = {"motor_position_rad": np.cumsum(velocity) * STEP_S, "torque_n_m": torque}
    found = plant_values([Recording("one way", columns, STEP_S)])
    assert found.inertia.value == pytest.approx(0.02, rel=0.05)
    assert found.one_way is not None
    assert found.one_way.value == pytest.approx(0.8 + way * 0.1, rel=0.02)
    assert found.one_way.std_error < 0.05
    assert not found.coulomb.significant
    assert found.coulomb.value == found.one_way.value  # a bench without a load makes the torque too
    assert found.offset.value == 0.0


def test_rows_between_which_the_axis_turns_are_refused() -> None:
    time = np.arange(400) * 0.1
    columns = {"motor_position_rad": np.cos(np.pi * time / 0.1), "torque_n_m": np.ones(400)}
    with pytest.raises(InputError, match="keeps sliding one way"):
        plant_values([Recording("turns", columns, 0.1)])
