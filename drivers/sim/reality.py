"""Recordings of the simulated axis under its servo: the closed loop in one compiled call."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.sim.axis import AxisTruth
from drivers.sim.effects import Effect
from drivers.sim.kernel import advance
from drivers.sim.plant import Plant
from drivers.sim.sensors import Sensors
from drivers.sim.servo import SERVO_STATE, Servo, pack_servo, position_loop, start_servo, velocity_loop


@njit(cache=True)
def _loop(
    p: np.ndarray,
    s: np.ndarray,
    lines: np.ndarray,
    c: np.ndarray,
    command_m: np.ndarray,
    command_m_s: np.ndarray,
    steps: int,
    rows: np.ndarray,
) -> None:
    plant, state, servo = p[0], s[0], c[0]
    memory: Any = np.zeros(1, SERVO_STATE)[0]
    start_servo(memory, state.motor_seen)
    for k in range(command_m.size):
        rows[0, k], rows[1, k] = state.motor_recorded, state.table_recorded
        reference = position_loop(servo, memory, command_m[k], command_m_s[k], state.motor_seen, state.table_seen)
        command = velocity_loop(servo, memory, reference / servo.ratio, state.motor_seen)
        advance(plant, state, lines, command, steps)
        rows[2, k], rows[3, k] = command, state.torque_recorded


def record(
    axis: AxisTruth,
    sensors: Sensors | None,
    effects: Sequence[Effect],
    servo: Servo,
    position_command_m: NDArray[np.float64],
    velocity_command_m_s: NDArray[np.float64],
    period_s: float = 1e-3,
    seed: int = 0,
    step_s: float = 1e-5,
) -> dict[str, NDArray[np.float64]]:
    """Canonical channels (K,) of one closed-loop run along set-points (K,), starting at rest on the first one.

    Row k holds the encoders at tick k, the torque command computed from them, and the measured torque as its mean over
    the following period. Linear axis: motor_position_m, force_command_n, force_n and no table_position_m.
    Raises ValueError for set-points of different shape, and as Plant does.
    """
    command_m = np.ascontiguousarray(position_command_m, dtype=np.float64)
    command_m_s = np.ascontiguousarray(velocity_command_m_s, dtype=np.float64)
    if command_m.ndim != 1 or command_m.shape != command_m_s.shape or command_m.size == 0:
        raise ValueError(
            "position_command_m, velocity_command_m_s: must be 1-D, not empty and of the same length, "
            f"got shapes {command_m.shape} and {command_m_s.shape}"
        )
    plant = Plant(axis, sensors, effects, seed, step_s)
    plant.reset(float(command_m[0]))
    if "velocity_filter_lag" in plant.effects:
        lag_s = plant.effects["velocity_filter_lag"].parameters["time_constant_s"]
        servo = replace(servo, velocity_filter_s=lag_s)
    rows = np.empty((4, command_m.size))
    constants = pack_servo(servo, axis.drive_ratio_m_rad, period_s)
    _loop(plant.parameters, plant.state, plant.lines, constants, command_m, command_m_s, plant.steps_in(period_s), rows)
    channels = {
        "time_s": np.arange(command_m.size) * period_s,
        "position_command_m": command_m,
        "velocity_command_m_s": command_m_s,
    }
    if axis.linear:
        return channels | {"motor_position_m": rows[0], "force_command_n": rows[2], "force_n": rows[3]}
    return channels | {
        "motor_position_rad": rows[0],
        "table_position_m": rows[1],
        "torque_command_n_m": rows[2],
        "torque_n_m": rows[3],
    }
