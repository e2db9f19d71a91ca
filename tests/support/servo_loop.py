"""A servo axis in closed loop with known settings: one inertia with friction, stepped finely beside the controller."""

from __future__ import annotations

import numpy as np
from diagnosis_runs import SEGMENTS, moves

from hil.bench.bench_file import Bench
from hil.control import cascade
from hil.motion.trajectory import plan
from hil.recording.recording import Recording

STEPS = 10  # of the axis in each control period: the loop may be late by tenths of a row
SMOOTH_RAD_S = 0.01  # speed at which friction has most of its level


def one_encoder(bench: Bench) -> Bench:
    """The bench without its linear encoder."""
    return bench.model_copy(update={"encoders": bench.encoders.model_copy(update={"table": None})})


def servo_run(
    bench: Bench,
    old_rows: float = 0.0,
    late_rows: int = 0,
    scale: float = 1.0,
    times: int = 1,
    differenced: bool = False,
    added: np.ndarray | None = None,
) -> Recording:
    """Record the law of `bench` on one inertia; the loop sees positions of `old_rows` ago.

    It moves `times` times through the segments, uses the recorded set-points `late_rows` later, and records its speed
    set-point in units of `scale` m/s. Its feed-forward is the velocity of the profile, or the last difference of the
    position set-points (`differenced`). `added` [N m] at each row is added to its command.
    """
    gains = bench.gains
    period_s, ratio = gains.period_s, gains.ratio_m_rad
    physics = bench.axis.physics()
    inertia = float(physics.chain.inertia_kg_m2.sum())
    trajectory = plan(moves(SEGMENTS, times), period_s)
    rows, ahead = np.arange(trajectory.position_m.size), trajectory.velocity_m_s
    if differenced:
        ahead = np.diff(trajectory.position_m, prepend=trajectory.position_m[0]) / period_s
    used = np.clip(rows - late_rows, 0, rows[-1])
    count, step_s = bench.motor_count, period_s / STEPS
    angle = speed = 0.0
    past = [0.0] * (20 * STEPS)
    state = cascade.init(0.0, period_s=period_s)
    motor, torque, reference = np.empty(rows.size), np.empty(rows.size), np.empty(rows.size)
    for k in rows:
        motor[k] = np.round(angle / count) * count
        seen = np.round(past[-1 - round(STEPS * old_rows)] / count) * count
        inputs = cascade.Inputs(trajectory.position_m[used[k]], float(ahead[used[k]]), seen, ratio * seen)
        state, outputs = cascade.step(gains, state, inputs)
        torque[k], reference[k] = outputs
        torque[k] += 0.0 if added is None else added[k]
        for _ in range(STEPS):
            friction = physics.coulomb_n_m * np.tanh(speed / SMOOTH_RAD_S) + physics.viscous_n_m_s_rad * speed
            speed += step_s * (torque[k] - friction) / inertia
            angle += step_s * speed
            past = [*past[1:], angle]
    noise = np.random.default_rng(1).normal(0.0, 0.01, rows.size)
    return Recording(
        "servo",
        {
            "time_s": rows * period_s,
            "position_command_m": trajectory.position_m,
            "velocity_command_m_s": trajectory.velocity_m_s,
            "motor_position_rad": motor,
            "torque_command_n_m": torque,
            "torque_n_m": torque + noise,
            "velocity_reference_m_s": reference / scale,
        },
        period_s,
    )
