"""A screw axis with its position loop on the linear encoder, by its own equations: two masses, guideway friction.

    m1 x1'' = F - F1 sign(x1') - f x1' - k (x1 - x2) - d (x1' - x2')
    m2 x2'' = k (x1 - x2) + d (x1' - x2') - Fg sign(x2')

Position loop: kv (x_set - x2) + v_set every `ticks` rows (`on_motor`: - x1); PI velocity loop on the difference of the
motor's encoder every row. No function of the twin takes part.
"""

from __future__ import annotations

import math

import numpy as np

from hil.recording.recording import Recording

PERIOD_S, STEPS = 1e-3, 40
LEAD_M, MOTOR_KG, TABLE_KG, DAMPING = 0.010, 300.0, 400.0, 0.03
MOTOR_N, VISCOUS_N_S_M = 350.0, 1500.0  # friction at the screw, seen at the table
POSITION_GAIN_1_S, VELOCITY_GAIN_N_M_S_RAD, INTEGRAL_TIME_S, TICKS = 30.0, 0.25, 8e-3, 4
MOTOR_COUNT_RAD, TABLE_COUNT_M = 2.0 * math.pi / 2**20, 1e-7
MOVES = ((0.06, 0.1), (0.0, 0.25), (0.04, 0.15), (0.0, 0.06), (0.0015, 0.004), (0.0, 0.004))


def set_points() -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and velocities [m/s] of sine-squared moves, to a place at a top speed."""
    place, parts = 0.0, [np.zeros(200)]
    for target, top_m_s in MOVES:
        length_s = 2.0 * abs(target - place) / top_m_s
        share = np.arange(1, round(length_s / PERIOD_S) + 1) * PERIOD_S / length_s
        parts += [place + (target - place) * (share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi))]
        parts += [np.full(100, target)]
        place = target
    position = np.concatenate(parts)
    return position, np.gradient(position, PERIOD_S)


def table_run(
    guideway_n: float = 300.0, stiffness_n_m: float = 5e7, on_motor: bool = False, noise_n_m: float = 0.01
) -> Recording:
    """Record the axis."""
    position, velocity = set_points()
    ratio, step_s, rng = LEAD_M / (2.0 * math.pi), PERIOD_S / STEPS, np.random.default_rng(1)
    damping = 2.0 * DAMPING * math.sqrt(stiffness_n_m * MOTOR_KG * TABLE_KG / (MOTOR_KG + TABLE_KG))
    x1 = x2 = v1 = v2 = before = integral = wanted = 0.0
    rows = np.empty((position.size, 3))

    def slowed(speed: float, friction_m_s2: float) -> float:
        return math.copysign(max(abs(speed) - step_s * friction_m_s2, 0.0), speed)

    for k in range(position.size):
        motor = round(x1 / ratio / MOTOR_COUNT_RAD) * MOTOR_COUNT_RAD
        table = round(x2 / TABLE_COUNT_M) * TABLE_COUNT_M
        if k % TICKS == 0:
            wanted = POSITION_GAIN_1_S * (position[k] - (ratio * motor if on_motor else table)) + velocity[k]
        error = wanted / ratio - (motor - before) / PERIOD_S
        torque = VELOCITY_GAIN_N_M_S_RAD * error + integral
        integral += VELOCITY_GAIN_N_M_S_RAD / INTEGRAL_TIME_S * error * PERIOD_S
        before, rows[k] = motor, (motor, table, torque)
        for _ in range(STEPS):
            spring = stiffness_n_m * (x1 - x2) + damping * (v1 - v2)
            v1 = slowed(v1 + step_s * (torque / ratio - VISCOUS_N_S_M * v1 - spring) / MOTOR_KG, MOTOR_N / MOTOR_KG)
            v2 = slowed(v2 + step_s * spring / TABLE_KG, guideway_n / TABLE_KG)
            x1, x2 = x1 + step_s * v1, x2 + step_s * v2
    return Recording(
        "table_loop",
        {
            "time_s": np.arange(position.size) * PERIOD_S,
            "position_command_m": position,
            "velocity_command_m_s": velocity,
            "motor_position_rad": rows[:, 0],
            "table_position_m": rows[:, 1],
            "torque_command_n_m": rows[:, 2],
            "torque_n_m": rows[:, 2] + rng.normal(0.0, noise_n_m, position.size),
        },
        PERIOD_S,
    )
