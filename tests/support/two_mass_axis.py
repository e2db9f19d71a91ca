"""An axis of two masses with friction on both, simulated by its own equations: a motor, a spring, a load, two encoders.

    m_m q'' = T - k (q - x - gap) - c (q' - x') - F_m(q'),    m_t x'' = k (q - x - gap) + c (q' - x') - F_t(x')

in units of the load [m, kg, N]; friction is Coulomb and viscous, the loop a cascade of position and velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

LEAD_M = 0.02 * math.pi  # 0.01 m for a radian of the motor


@dataclass(frozen=True)
class TwoMassAxis:
    """Values of the axis, SI at the load; `gap_m` is lost motion."""

    motor_kg: float = 4.0
    load_kg: float = 14.0
    stiffness_n_m: float = 6e5
    damping_n_s_m: float = 300.0
    motor_friction_n: float = 6.0
    load_friction_n: float = 18.0
    motor_viscous_n_s_m: float = 10.0
    load_viscous_n_s_m: float = 30.0
    gap_m: float = 0.0


def columns(
    axis: TwoMassAxis, seconds: float = 16.0, noise_n_m: float = 0.03, seed: int = 1, scale_mm: float = 0.001
) -> dict[str, np.ndarray]:
    """t_s, set_mm, motor_deg, scale_mm, torque_Nm at 500 rows/s; `scale_mm` is a step of the scale, half its noise."""
    rng, rate, inner = np.random.default_rng(seed), 500, 40
    dt, rows = 1.0 / (rate * inner), int(seconds * rate)
    command = _moves(rows, rate, rng)
    q = x = command[0]
    vq = vx = integral = force = 0.0
    found = np.empty((rows, 3))
    for row in range(rows):
        wanted = 30.0 * (command[row] - q) + (command[min(row + 1, rows - 1)] - command[row]) * rate
        integral += 4000.0 * (wanted - vq) / rate
        force = min(max(600.0 * (wanted - vq) + integral, -900.0), 900.0)
        found[row] = q, x, force
        for _ in range(inner):
            apart = q - x
            apart = math.copysign(max(abs(apart) - 0.5 * axis.gap_m, 0.0), apart)
            spring = axis.stiffness_n_m * apart + axis.damping_n_s_m * (vq - vx)
            on_motor = axis.motor_friction_n * math.tanh(vq / 2e-4) + axis.motor_viscous_n_s_m * vq
            on_load = axis.load_friction_n * math.tanh(vx / 2e-4) + axis.load_viscous_n_s_m * vx
            vq += dt * (force - spring - on_motor) / axis.motor_kg
            vx += dt * (spring - on_load) / axis.load_kg
            q += dt * vq
            x += dt * vx
    ratio = LEAD_M / (2.0 * math.pi)
    count = math.radians(360.0 / 65536.0)
    return {
        "t_s": np.arange(rows) / rate,
        "set_mm": 1e3 * command,
        "motor_deg": np.degrees(np.floor(found[:, 0] / ratio / count) * count),
        "scale_mm": scale_mm * np.round((1e3 * found[:, 1] + rng.normal(0.0, 2.0 * scale_mm, rows)) / scale_mm),
        "torque_Nm": found[:, 2] * ratio + rng.normal(0.0, noise_n_m, rows),
    }


def _moves(rows: int, rate: int, rng: np.random.Generator) -> np.ndarray:
    """Set-points [m] of sine-squared moves there and back, with rests."""
    parts, place = [np.zeros(rate // 5)], 0.0
    while sum(map(len, parts)) < rows:
        target, duration = rng.uniform(-0.25, 0.25), rng.uniform(0.3, 1.0)
        phase = np.arange(int(duration * rate)) / int(duration * rate)
        parts += [place + (target - place) * (phase - np.sin(2.0 * np.pi * phase) / (2.0 * np.pi))]
        parts += [np.full(int(0.1 * rate), target)]
        place = target
    return np.concatenate(parts)[:rows]
