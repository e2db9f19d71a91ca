"""Timing of a held command: at the rows it is told apart from instants that differ from step to step."""

from __future__ import annotations

import numpy as np
import pytest

from hil.identification.residual_scales import unknown_share
from hil.identification.sensor_noise import is_held

PERIOD_S, INERTIA, VISCOUS, FINE = 0.02, 0.04, 0.4, 100


def moved(late: bool) -> tuple[np.ndarray, np.ndarray]:
    """Command of 4000 rows that switches at random rows, and the motor under it; `late`: at random instants after."""
    random = np.random.default_rng(0)
    command = np.repeat(np.where(random.random(200) < 0.5, -1.0, 1.0), 20)
    fine = np.repeat(command, FINE)
    if late:
        for row in np.flatnonzero(np.diff(command)) + 1:
            fine[row * FINE : row * FINE + random.integers(FINE)] = command[row - 1]
    step_s, speed, motor = PERIOD_S / FINE, 0.0, np.zeros(fine.size)
    for index, torque in enumerate(fine[:-1]):
        speed += step_s * (torque - VISCOUS * speed) / INERTIA
        motor[index + 1] = motor[index] + step_s * speed
    return command, motor[::FINE] + random.normal(0.0, 2e-4, command.size)


@pytest.mark.parametrize(("late", "low", "high"), [(False, 0.0, 0.1), (True, 0.6, 1.0)])
def test_the_share_of_the_unknown_torque_is_that_of_the_instants(late: bool, low: float, high: float) -> None:
    command, motor = moved(late)
    gap = np.abs(np.diff(command, append=command[-1])) / np.sqrt(12.0)
    assert low <= unknown_share(command, motor, gap, PERIOD_S, INERTIA) <= high


def test_a_torque_that_changes_at_each_row_tells_nothing_of_its_instants() -> None:
    _, motor = moved(late=False)
    torque = np.random.default_rng(1).normal(0.0, 1.0, motor.size)
    assert not is_held(torque, motor)
    assert unknown_share(torque, motor, np.abs(torque), PERIOD_S, INERTIA) == 1.0
