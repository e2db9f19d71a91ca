"""Transmission of a rigid axis: no spring gives way, so the table follows its motor by the lead, and rests in a gap."""

from __future__ import annotations

import numpy as np
import pytest

from hil.arrays import FloatArray
from hil.bench.axis_models import Rigid
from hil.control.cascade import Gains
from hil.twin.axis import Response, Twin
from hil.twin.physics import Active

LEAD_M, RATIO_M, PERIOD_S = 0.01, 0.01 / (2.0 * np.pi), 1e-3
AXIS = Rigid(model="rigid", lead_m=LEAD_M, mass_kg=400.0, coulomb_torque_n_m=0.2, viscous_torque_n_m_s_rad=1e-3)
GAINS = Gains(30.0, 1.0, 0.1, 0.0, 10.0, RATIO_M, PERIOD_S, 1, False, False, 1.0)
TORQUE = 0.8 * np.sin(2.0 * np.pi * 1.3 * np.arange(3000) * PERIOD_S) * np.linspace(1.0, 0.4, 3000)


def driven(*active: Active) -> Response:
    """Motor and table under a torque that reverses."""
    return Twin(AXIS.physics(), GAINS, active).drive(TORQUE)


def play(motor_m: FloatArray, gap_m: float) -> FloatArray:
    """Table (n,) that friction holds until a side of the gap pushes it, from the middle of the gap."""
    table, at = np.empty(motor_m.size), motor_m[0]
    for index, pushed in enumerate(motor_m):
        at = min(max(at, pushed - 0.5 * gap_m), pushed + 0.5 * gap_m)
        table[index] = at
    return table


@pytest.mark.parametrize("variant", [0, 1])
def test_the_table_stays_behind_by_the_gap(variant: int) -> None:
    moved = driven(Active("backlash", (3e-4,), variant))
    np.testing.assert_allclose(moved.table_position_m, play(RATIO_M * moved.motor_position, 3e-4), atol=1e-12)
    assert np.ptp(moved.table_position_m - RATIO_M * moved.motor_position) == pytest.approx(3e-4)


def test_a_lead_error_moves_the_table_and_no_force_the_motor() -> None:
    right, wrong = driven(), driven(Active("cumulative_lead_error", (1e-3,), 0))
    np.testing.assert_allclose(wrong.motor_position, right.motor_position, atol=1e-12)
    np.testing.assert_allclose(wrong.table_position_m, 1.001 * right.table_position_m, rtol=1e-12, atol=1e-15)


def test_play_beside_a_lead_error() -> None:
    moved = driven(Active("cumulative_lead_error", (1e-3,), 0), Active("backlash", (2e-4,), 0))
    expected = play(1.001 * RATIO_M * moved.motor_position, 2e-4)
    np.testing.assert_allclose(moved.table_position_m, expected, atol=1e-12)


def test_a_soft_zone_is_none_without_a_spring() -> None:
    moved = driven(Active("preload_loss", (2e-4, 0.4), 0))
    np.testing.assert_allclose(moved.table_position_m, RATIO_M * moved.motor_position, atol=1e-6)
