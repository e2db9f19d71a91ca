"""Comparison of the two encoders and of the motor encoder with the torque, tick by tick, without devices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bench_runs import bench_with

from hil.loop.bounds import make_bounds
from hil.loop.checks import Bounds, Facts, Limit, Memory, check
from hil.loop.devices import Rig

STEP_M = 1e-5


@pytest.fixture(scope="module")
def bounds() -> Bounds:
    with Rig(bench_with(drive={"mode": "cst"})) as rig:
        return make_bounds(rig, None)._replace(following_error_m=math.inf)


def facts(command_m: float, motor_m: float, table_m: float, torque: float = 0.0, command: float = 0.0) -> Facts:
    return Facts(command_m, 0.0, motor_m, table_m, motor_m, torque, command, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, 1e-3)


@pytest.mark.parametrize(("turned", "found"), [("motor", Limit.MOTOR_REVERSED), ("table", Limit.TABLE_REVERSED)])
def test_an_encoder_that_turns_round_in_motion_is_found_where_it_turned(
    bounds: Bounds, turned: str, found: Limit
) -> None:
    """After 19 mm in which both agreed: the way since then counts, not the way since the start."""
    limits, memory = np.array(bounds), np.zeros(len(Memory))
    for k in range(1900):
        assert check(limits, memory, facts(k * STEP_M, k * STEP_M, k * STEP_M)) == 0
    turn_m = 1899 * STEP_M
    for k in range(1, 400):
        there, back = turn_m + k * STEP_M, turn_m - k * STEP_M
        motor_m, table_m = (back, there) if turned == "motor" else (there, back)
        passed = check(limits, memory, facts(there, motor_m, table_m))
        if passed:
            break
    assert passed == found
    assert k * STEP_M <= 2.0 * bounds.frozen_m + 10 * STEP_M  # the speed of both adds to the bound


def test_a_motor_encoder_is_frozen_against_the_torque_that_acts_and_not_against_its_command(bounds: Bounds) -> None:
    limits = np.array(bounds._replace(torque_difference=math.inf))
    for torque, expected in ((0.0, Limit.NONE), (1.1 * bounds.frozen_torque, Limit.MOTOR_FROZEN)):
        memory = np.zeros(len(Memory))
        assert check(limits, memory, facts(0.0, 0.0, 0.0)) == 0
        assert check(limits, memory, facts(0.0, 0.0, 0.0, torque, 1.1 * bounds.frozen_torque)) == expected
