"""A linear motor that cogs, without a known lead or control law, made by its own equations."""

from __future__ import annotations

import math

import numpy as np

from hil.bench.bench_file import Bench
from hil.recording.recording import Recording

PERIOD_S, STEPS = 1e-3, 10
MASS_KG, COULOMB_N, VISCOUS_N_S_M = 12.0, 15.0, 40.0
COGGING_N, PITCH_M = 8.0, 0.024
BENCH = Bench.model_validate(
    {
        "schema_version": 1,
        "name": "stage",
        "axis": {
            "model": "one_mass",
            "mass_kg": 11.5,
            "coulomb_force_n": 14.0,
            "viscous_force_n_s_m": 44.0,
        },
        "control": "unknown",
        "encoders": {"motor": {"resolution_m": 1e-7}, "table": None},
    }
)


def set_points(moves: list[tuple[float, float]]) -> np.ndarray:
    """Sine-squared moves there and back, (distance [m], top speed [m/s]), on the fine steps."""
    step_s, parts = PERIOD_S / STEPS, [np.zeros(1000)]
    for distance, speed in moves:
        time = np.arange(round(2.0 * distance / speed / step_s)) * step_s
        length = 2.0 * distance / speed
        there = 0.5 * speed * (time - length / (2.0 * math.pi) * np.sin(2.0 * math.pi * time / length))
        parts += [there, np.full(2000, distance), distance - there, np.zeros(2000)]
    return np.concatenate(parts)


def moved(moves: list[tuple[float, float]]) -> Recording:
    """Recording of the stage: position with counts, force with noise."""
    command, step_s, rng = set_points(moves), PERIOD_S / STEPS, np.random.default_rng(3)
    position = speed = force = integral = 0.0
    rows = []
    for step, wanted in enumerate(command):
        if step % STEPS == 0:
            read = round(position / 1e-7) * 1e-7
            ahead = (command[min(step + STEPS, command.size - 1)] - wanted) / PERIOD_S
            error = 60.0 * (wanted - read) + ahead - speed
            integral += 9.0 * error
            force = 1500.0 * error + integral
            rows.append((read, force + rng.normal(0.0, 0.3)))
        pull = force - VISCOUS_N_S_M * speed - COGGING_N * math.sin(2.0 * math.pi * position / PITCH_M + 0.8)
        speed += pull / MASS_KG * step_s
        loss = COULOMB_N / MASS_KG * step_s
        speed = math.copysign(max(abs(speed) - loss, 0.0), speed)
        position += speed * step_s
    columns = np.array(rows).T
    return Recording(name="stage", period_s=PERIOD_S, columns={"motor_position_m": columns[0], "force_n": columns[1]})
