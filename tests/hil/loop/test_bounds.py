"""Bounds of the supervision as they follow from a bench file, and a stop that is planned within them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from bench_runs import MOVE, bench_with

from hil.bench.hardware import DriveMode
from hil.loop.bounds import make_bounds, make_cycle
from hil.loop.cycle import Setpoint
from hil.loop.devices import Rig
from hil.loop.limits import Bounds
from hil.loop.simulated_bench import load_simulated
from hil.loop.stopping import plan_stop
from hil.motion.pieces import MotionLimits
from hil.motion.time_optimal import MotionState

LIMITS = MotionLimits(velocity_m_s=0.4, acceleration_m_s2=2.0, jerk_m_s3=100.0)
TORQUE_N_M, GAIN_1_S = 12.0, 36.84  # of the reference bench


def bounds_of(limits: MotionLimits | None = LIMITS, table: dict[str, Any] | None = None, **drive: Any) -> Bounds:
    changes: dict[str, dict[str, Any]] = {"drive": drive}
    if table is not None:
        changes["encoders"] = {"table": table}
    with Rig(bench_with(**changes)) as rig:
        rig.set_up()
        return make_bounds(rig, limits)


def test_bounds_follow_from_limits_gains_and_following_error() -> None:
    bounds = bounds_of(following_error_m=0.002, travel_m=(-0.05, 0.3))
    assert bounds.has_table
    assert bounds.commands_torque
    assert (bounds.following_error_m, bounds.following_error_s) == (0.002, 0.0)
    assert (bounds.travel_low_m, bounds.travel_high_m) == (-0.05, 0.3)
    assert bounds.deceleration_m_s2 == 2.0
    assert bounds.velocity_m_s == pytest.approx(1.5 * 0.4 + GAIN_1_S * 0.002)
    assert bounds.encoder_difference_m == 0.002
    assert bounds.frozen_m == pytest.approx(0.1 * 0.002)
    assert bounds.torque == pytest.approx(1.5 * TORQUE_N_M)
    assert bounds.torque_difference == pytest.approx(0.3 * TORQUE_N_M)
    assert bounds.frozen_torque == pytest.approx(0.5 * min(TORQUE_N_M, bounds.drive_torque))
    assert math.isfinite(bounds.drive_torque)
    off = (bounds.continuous_torque, bounds.residual_motor_m, bounds.residual_table_m, bounds.residual_torque)
    assert off == (math.inf,) * 4


def test_an_axis_runs_away_by_what_full_torque_gives_in_three_periods_and_the_swing_of_its_motor() -> None:
    """Two masses: after a step of the torque the motor swings by 2 a m2 / (m1 w), w^2 = k (1 / m1 + 1 / m2)."""
    motor_kg, table_kg, stiffness_n_m, ratio_m_rad = 335.0, 384.0, 5.64e7, 0.01 / (2.0 * math.pi)
    full_m_s2 = TORQUE_N_M / ratio_m_rad / (motor_kg + table_kg)
    swing_s = 2.0 * table_kg / motor_kg / math.sqrt(stiffness_n_m * (1.0 / motor_kg + 1.0 / table_kg))
    count_m = 0.01 / 2**20
    assert bounds_of().runaway_m_s == pytest.approx(full_m_s2 * (3e-3 + swing_s) + 2.0 * count_m / 1e-3, rel=1e-3)


def test_a_load_may_drive_the_axis_with_half_of_the_torque_that_can_act() -> None:
    assert bounds_of().load_torque == pytest.approx(0.5 * TORQUE_N_M)
    assert bounds_of(supervision={"load_torque": 8.0}).load_torque == 8.0
    with Rig(load_simulated("emps")) as rig:  # its control law has no limit, its drive has one of 300 N
        rig.set_up()
        bounds = make_bounds(rig, LIMITS)
        assert (bounds.load_torque, bounds.torque_difference) == (150.0, 90.0)
        assert rig.drive.stop_margin == pytest.approx(150.0 / 8557.43)


@pytest.mark.parametrize(("error_m", "sign_m"), [(0.0012, 0.0003), (0.002, 0.0005), (0.02, 0.0005)])
def test_the_first_motion_shows_its_sign_within_half_a_millimetre(error_m: float, sign_m: float) -> None:
    assert bounds_of(following_error_m=error_m).sign_m == pytest.approx(sign_m)
    soft = bench_with(drive={"following_error_m": error_m}, control={"velocity_integral_time_ms": None})
    with Rig(soft) as rig:  # without an integrator the position loop holds the load: 6 N m / (Kp Kv)
        gains = soft.gains
        held_rad = 6.0 / (gains.velocity_gain_n_m_s_rad * gains.position_gain_1_s)
        assert make_bounds(rig, LIMITS).sign_m == pytest.approx(held_rad * gains.ratio_m_rad)
    coarse = bounds_of(following_error_m=error_m, table={"resolution_m": 2e-4})
    assert coarse.sign_m == pytest.approx(8e-4)


def test_bounds_of_the_bench_come_first() -> None:
    residual = {"motor_m": 1e-5, "table_m": 2e-5, "torque": 0.5}
    given = {"velocity_m_s": 0.7, "encoder_difference_m": 0.004, "frozen_m": 0.001, "frozen_torque": 1.0, "torque": 9.0,
             "torque_difference": 2.0, "continuous_torque": 3.0, "thermal_time_s": 20.0, "following_error_s": 0.01,
             "residual": residual}  # fmt: skip
    bounds = bounds_of(supervision=given)
    assert {name: getattr(bounds, name) for name in given if name != "residual"} == {
        name: value for name, value in given.items() if name != "residual"
    }
    assert (bounds.residual_motor_m, bounds.residual_table_m, bounds.residual_torque) == (1e-5, 2e-5, 0.5)
    assert bounds_of(supervision={"residual": residual | {"table_m": None}}).residual_table_m == math.inf


def test_an_encoder_of_few_counts_is_frozen_only_after_four_of_them() -> None:
    bounds = bounds_of(following_error_m=0.002, table={"resolution_m": 1e-4})
    assert bounds.frozen_m == pytest.approx(4e-4)


def test_a_bench_without_a_table_encoder_has_bounds_all_the_same() -> None:
    with Rig(bench_with(encoders={"table": None}, drive={"following_error_m": 0.002})) as rig:
        bounds = make_bounds(rig, LIMITS)
    assert not bounds.has_table
    assert bounds.frozen_m == pytest.approx(0.1 * 0.002)


def test_limits_of_the_profile_come_before_those_of_the_bench() -> None:
    limits = {"velocity_m_s": 0.2, "acceleration_m_s2": 1.0, "jerk_m_s3": 50.0}
    bench = bench_with(drive={"limits": limits, "travel_m": None})
    with Rig(bench) as rig:
        assert make_bounds(rig, LIMITS).deceleration_m_s2 == 2.0
        assert make_bounds(rig, None).deceleration_m_s2 == 1.0
        assert make_bounds(rig, None).velocity_m_s == pytest.approx(
            1.5 * 0.2 + GAIN_1_S * rig.section.following_error_m
        )
        assert (make_bounds(rig, None).travel_low_m, make_bounds(rig, None).travel_high_m) == (-math.inf, math.inf)
    with Rig(bench_with(drive={"limits": None})) as rig:
        assert (make_bounds(rig, None).velocity_m_s, make_bounds(rig, None).deceleration_m_s2) == (math.inf, math.inf)


@pytest.mark.parametrize(
    ("mode", "setpoint"),
    [("cst", Setpoint.TORQUE), ("csv", Setpoint.VELOCITY), ("csp", Setpoint.POSITION)],
)
def test_the_cycle_commands_what_the_mode_of_the_drive_takes(mode: str, setpoint: Setpoint) -> None:
    with Rig(bench_with(drive={"mode": mode})) as rig:
        cycle = make_cycle(rig, 0.5)
        assert cycle.loop.setpoint == setpoint
        assert cycle.bounds == make_bounds(rig, None)
        assert cycle.bounds.commands_torque == (rig.section.mode is DriveMode.CST)
        assert "motor_position_rad" in cycle.channels


# -- stops ------------------------------------------------------------------------------------------------------------


def stop(state: MotionState, limits: MotionLimits = MOVE.motion_limits, velocity_m_s: float = 1.0) -> Any:
    with Rig(bench_with()) as rig:
        bounds = make_bounds(rig, limits)._replace(velocity_m_s=velocity_m_s)
    return plan_stop(state, limits, bounds, 1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stop_is_planned_up_to_the_bound_of_the_velocity(sign: float) -> None:
    assert stop(MotionState(0.0, sign * 1.0, 0.0)) is not None
    assert stop(MotionState(0.0, sign * 1.001, 0.0)) is None
    unbounded = {"velocity_m_s": math.inf}  # then twice the limit of the profile, 0.6 m/s
    assert stop(MotionState(0.0, sign * 1.2, 0.0), **unbounded) is not None
    assert stop(MotionState(0.0, sign * 1.201, 0.0), **unbounded) is None


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_stop_is_planned_from_a_value_that_is_no_number(place: int, value: float) -> None:
    state = [0.0, 0.1, 0.0]
    state[place] = value
    assert stop(MotionState(*state)) is None


@pytest.mark.parametrize(
    ("velocity_m_s", "acceleration_m_s2", "limit_m_s2", "limit_m_s3", "planned"),
    [
        (0.5, 0.0, 0.0625, 0.0625, True),  # 8 s at the limit and twice 1 s of jerk: 10 s
        (-0.5, 0.0, 0.0616, 0.0616, False),  # 8.1 s and 2 s
        (0.5, 0.0, 0.064, 0.055, False),  # 7.8 s and 2.3 s
        (0.5, 0.01, 0.064, 0.064, True),  # 0.16 s more to take the acceleration back
        (0.5, -0.02, 0.064, 0.064, False),  # 0.31 s more
        (0.0, 0.0, 0.064, 0.064, True),
    ],
)
def test_no_stop_is_planned_that_takes_longer_than_ten_seconds(
    velocity_m_s: float, acceleration_m_s2: float, limit_m_s2: float, limit_m_s3: float, planned: bool
) -> None:
    limits = MotionLimits(0.6, limit_m_s2, limit_m_s3)
    found = stop(MotionState(0.1, velocity_m_s, acceleration_m_s2), limits)
    assert (found is not None) == planned
    if found is not None:
        assert found.velocity_m_s[-1] == 0.0
