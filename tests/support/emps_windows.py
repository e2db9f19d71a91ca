"""The EMPS recording with forces added through a linear model of its closed loop, written without the twin.

    m a = u + F - f v,   u = g kv (kp (q_g - q) - v_m),   v_m: difference of the two-sample means of q

All are linear in F beside the Coulomb friction, which does not change while the axis slides in one direction: the
response of q and u to F alone is added to what was recorded. Values of the recording's description: mass and viscous
friction of its published identification, gains of its control law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from measured_recordings import emps
from scipy.linalg import expm

from hil.identification.estimator import Fit
from hil.recording.recording import Recording

MASS_KG, VISCOUS_N_S_M = 95.1, 203.5
POSITION_GAIN_1_S, VELOCITY_GAIN_V_S_M, FORCE_PER_VOLT = 160.18, 243.45, 35.15065
PERIOD_S, SUBSTEPS = 1e-3, 10
EDGE_S, NEAR_REVERSAL_S = 0.005, 0.02  # errors of an edge that are allowed


class Push(NamedTuple):
    """A window [s] and the force on the table in it [N]."""

    start_s: float
    end_s: float
    force_n: float


def pushed(pushes: Sequence[Push]) -> Recording:
    """The recording with forces on the table."""
    recording = emps()
    position_m, force_n = response(len(recording), pushes)
    columns = dict(recording.columns)
    columns["motor_position_m"] = columns["motor_position_m"] + position_m
    for name in ("force_command_n", "force_n"):
        columns[name] = columns[name] + force_n
    return replace(recording, columns=columns)


def response(rows: int, pushes: Sequence[Push]) -> tuple[np.ndarray, np.ndarray]:
    """Change of position [m] and of the force of the motor [N], each (rows,), by forces on the table."""
    step_s = PERIOD_S / SUBSTEPS
    begin_s = np.arange(rows * SUBSTEPS) * step_s
    force = np.zeros(begin_s.size)
    for start_s, end_s, height_n in pushes:
        overlap_s = np.minimum(end_s, begin_s + step_s) - np.maximum(start_s, begin_s)
        force += height_n * np.maximum(overlap_s, 0.0) / step_s
    # position, velocity, and the force held over a step
    exact = expm(np.array([[0, 1, 0], [0, -VISCOUS_N_S_M / MASS_KG, 1 / MASS_KG], [0, 0, 0]]) * step_s)
    position = velocity = before = before_that = 0.0
    positions, motor = np.empty(rows), np.empty(rows)
    for row in range(rows):
        mean_speed = 0.5 * (position - before_that) / PERIOD_S
        positions[row] = position
        motor[row] = FORCE_PER_VOLT * VELOCITY_GAIN_V_S_M * (-POSITION_GAIN_1_S * position - mean_speed)
        before, before_that = position, before
        for extra in force[row * SUBSTEPS : (row + 1) * SUBSTEPS]:
            position, velocity, _ = exact @ (position, velocity, motor[row] + extra)
    return positions, motor


def regular(count: int, height_n: float, start_s: float = 0.6, end_s: float = 24.3) -> list[Push]:
    """Windows of equal height and width at equal intervals."""
    period_s = (end_s - start_s) / count
    width_s = min(0.4, 0.32 * period_s)
    return [Push(start_s + k * period_s, start_s + k * period_s + width_s, height_n) for k in range(count)]


def irregular(count: int, seed: int, start_s: float = 0.6, end_s: float = 24.3) -> list[Push]:
    """Windows of 50 to 500 ms and 20 to 200 N of either sign at random times, at least 50 ms apart."""
    rng = np.random.default_rng(seed)
    places = np.linspace(start_s, end_s, count + 1)
    found = []
    for first, last in pairwise(places):
        width_s = rng.uniform(0.05, min(0.5, 0.7 * (last - first)))
        begin_s = rng.uniform(first, last - width_s - 0.05)
        height_n = rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(np.log(20.0), np.log(200.0)))
        found.append(Push(float(begin_s), float(begin_s + width_s), float(height_n)))
    return found


def windows(found: Fit) -> list[tuple[float, ...]]:
    """Start [s], end [s] and force [N] of all windows of a fit, by time."""
    values = [term.at(window) for term in found.terms for window in term.windows]
    return sorted((start, end, force) for force, start, end in values)


def edge_s(at_s: float) -> float:
    """Error allowed for an edge: more where the axis reverses, since friction hides a force there."""
    reversals_s = 3.1035 + 3.12 * np.arange(7)
    return NEAR_REVERSAL_S if np.min(np.abs(reversals_s - at_s)) < 0.05 else EDGE_S


def assert_found(found: Sequence[tuple[float, ...]], pushes: list[Push]) -> None:
    assert len(found) == len(pushes)
    for (start_s, end_s, _), push in zip(found, pushes, strict=True):
        assert start_s == pytest.approx(push.start_s, abs=edge_s(push.start_s))
        assert end_s == pytest.approx(push.end_s, abs=edge_s(push.end_s))
