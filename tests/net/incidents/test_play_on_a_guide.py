"""Play of an axis whose table has friction of its own, simulated by other equations; the split of masses is unknown."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnose import diagnose
from hil.recording.recording import Recording

pytestmark = pytest.mark.net

RATIO_M_RAD = 0.01 / (2.0 * math.pi)
GAP_M, STIFFNESS_N_M, DAMPING_N_S_M = 14e-6, 9e7, 9e3
MOTOR_KG_M2, TABLE_KG = 1.2e-3, 110.0
MOTOR_N_M, TABLE_N = 0.3, 60.0  # Coulomb friction: a quarter of it acts on the table
MOTOR_N_M_S, TABLE_N_S_M = 4e-3, 200.0
PERIOD_S, STEPS = 1e-3, 25  # of the control, and internal steps in it
BENCH = Bench.model_validate(
    {
        "schema_version": 1,
        "name": "guide",
        "axis": {
            "model": "two_mass",
            "lead_m": 0.01,
            "motor_mass_kg": 290.0,  # half of the sum, as drafted where nothing tells the split
            "table_mass_kg": 290.0,
            "stiffness_n_m": 4.4e7,
            "coulomb_torque_n_m": 0.393,
            "viscous_torque_n_m_s_rad": 0.0045,
        },
        "control": "unknown",
        "encoders": {"motor": {"counts_per_rev": 131072}, "table": {"resolution_m": 1e-7}},
    }
)


def slowed(speed: float, loss: float) -> float:
    """Speed after the impulse of Coulomb friction."""
    return math.copysign(max(abs(speed) - loss, 0.0), speed)


def recorded() -> Recording:
    """Moves of 60 mm there and back, with play and friction on both sides."""
    step_s, rng, moves = PERIOD_S / STEPS, np.random.default_rng(10), []
    for speed in (0.05, 0.15, 0.3, 0.05, 0.3):
        time = np.arange(round(0.12 / speed / step_s)) * step_s
        there = 0.5 * speed * (time - 0.12 / speed / (2 * math.pi) * np.sin(2 * math.pi * time * speed / 0.12))
        moves += [np.zeros(8000), there, np.full(8000, 0.06), 0.06 - there]
    command = np.concatenate(moves)
    angle = turning = table = sliding = torque = integral = 0.0
    rows = []
    for step, wanted in enumerate(command):
        if step % STEPS == 0:
            ahead = (command[min(step + STEPS, command.size - 1)] - wanted) / PERIOD_S / RATIO_M_RAD
            error = (wanted / RATIO_M_RAD - angle) * 40.0 + ahead - turning
            integral += error * PERIOD_S / 0.02
            torque = 0.4 * (error + integral)
            rows.append((angle, table, torque))
        stretch = RATIO_M_RAD * angle - table
        inside = abs(stretch) <= 0.5 * GAP_M
        force = 0.0 if inside else STIFFNESS_N_M * (stretch - math.copysign(0.5 * GAP_M, stretch))
        force += 0.0 if inside else DAMPING_N_S_M * (RATIO_M_RAD * turning - sliding)
        turning += (torque - MOTOR_N_M_S * turning - force * RATIO_M_RAD) / MOTOR_KG_M2 * step_s
        turning = slowed(turning, MOTOR_N_M / MOTOR_KG_M2 * step_s)
        sliding = slowed(sliding + (force - TABLE_N_S_M * sliding) / TABLE_KG * step_s, TABLE_N / TABLE_KG * step_s)
        angle += turning * step_s
        table += sliding * step_s
    angles, tables, torques = np.array(rows).T
    columns = {
        "motor_position_rad": angles + rng.normal(0.0, 1.2e-5, angles.size),
        "table_position_m": np.round(tables / 1e-7) * 1e-7,
        "torque_n_m": torques + rng.normal(0.0, 0.015, angles.size),
    }
    return Recording(name="guide", period_s=PERIOD_S, columns=columns)


def test_play_is_told_beside_the_friction_of_the_table() -> None:
    """Each of the two alone fits worse than a wrong mechanism."""
    found = diagnose([recorded()], [], BENCH).result
    named = {finding.effect: finding.parameters for finding in found.findings}
    lost_m = [values[key].value for values in named.values() for key in ("gap_m", "zone_m") if key in values]
    assert len(lost_m) == 1, found.statement
    assert abs(lost_m[0] - GAP_M) < 0.07 * GAP_M
    assert 0.1 < named["table_side_friction"]["share"].value < 0.35
