"""Does the axis obey: torque against motion, the first motion, the effect of a controlled stop; each bound exactly."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from bench_runs import MOVING, bench_with, run
from checked_ticks import PERIOD_S, Checked

from drivers.cia402 import DriveState
from hil.loop.devices import Rig
from hil.loop.limits import Limit
from hil.loop.session import Session
from hil.loop.supervision import Ending

BOTH = pytest.mark.parametrize("sign", [1.0, -1.0])
LOAD, RUNAWAY_M_S, SIGN_M = 2.0, 2.0**-4, 2.0**-11


class Moving(Checked):
    """An axis whose speed and torque are given for each tick."""

    def __init__(self, **bounds: float) -> None:
        super().__init__(**({"load_torque": LOAD, "runaway_m_s": RUNAWAY_M_S} | bounds))
        self.motor_m = 0.0

    def at(self, speed_m_s: float, torque: float, **values: float) -> Limit:
        self.motor_m += speed_m_s * PERIOD_S
        return self.tick(motor_m=self.motor_m, torque=torque, **values)


@BOTH
def test_an_axis_that_gets_faster_against_its_torque_has_a_wrong_sign(sign: float) -> None:
    axis = Moving()
    assert axis.at(sign * 0.125, -sign * 2.5) == Limit.NONE
    assert axis.at(sign * (0.125 + RUNAWAY_M_S), -sign * 2.5) == Limit.NONE
    assert axis.at(sign * (0.125 + 1.01 * RUNAWAY_M_S), -sign * 2.5) == Limit.SIGN


def test_the_slowest_speed_against_the_torque_counts() -> None:
    axis = Moving()
    for speed_m_s in (0.5, 0.25, 0.3, 0.25 + RUNAWAY_M_S):
        assert axis.at(speed_m_s, -3.0) == Limit.NONE
    assert axis.at(0.25 + 1.01 * RUNAWAY_M_S, -3.0) == Limit.SIGN


def test_a_weight_may_drive_the_axis_up_to_the_load_torque() -> None:
    axis = Moving()
    assert {axis.at(0.01 * k, -LOAD) for k in range(100)} == {Limit.NONE}
    assert Limit.SIGN in {axis.at(1.0 + 0.01 * k, -1.01 * LOAD) for k in range(10)}


def test_a_torque_that_drives_or_pauses_begins_anew() -> None:
    for between in (3.0, -0.5):
        axis = Moving()
        assert axis.at(0.125, -3.0) == Limit.NONE
        assert axis.at(0.25, between) == Limit.NONE
        assert axis.at(0.25, -3.0) == Limit.NONE


def test_a_sample_that_is_late_is_no_speed() -> None:
    axis = Moving()
    axis.at(0.125, -3.0)
    assert axis.at(0.125, -3.0, motor_age=1) == Limit.NONE
    assert axis.at(0.125, -3.0) == Limit.NONE  # two periods of way in two periods of time


@BOTH
def test_the_first_motion_goes_where_the_set_points_go(sign: float) -> None:
    def first(moved_m: float, commanded_m: float) -> Limit:
        axis = Checked(sign_m=SIGN_M)
        return axis.tick(position_m=sign * commanded_m, fed_back_m=-sign * moved_m, velocity_m_s=sign * 0.1)

    assert first(SIGN_M, 1.0) == Limit.NONE
    assert first(1.0, SIGN_M) == Limit.NONE
    assert first(1.01 * SIGN_M, 1.01 * SIGN_M) == Limit.SIGN
    assert first(-1.0, 1.0) == Limit.NONE


def test_the_sign_of_a_motion_is_known_once_it_was_right() -> None:
    """Later a position error may have any sign: set-points that turn back under an axis that lags."""
    axis = Checked(sign_m=SIGN_M)
    assert axis.tick(position_m=0.1, fed_back_m=0.1, velocity_m_s=0.1) == Limit.NONE
    assert axis.tick(position_m=-0.1, fed_back_m=0.1, velocity_m_s=-0.1) == Limit.NONE


def test_what_the_axis_gives_way_before_the_set_points_move_does_not_count() -> None:
    axis = Checked(sign_m=SIGN_M)
    assert axis.tick(fed_back_m=-0.01) == Limit.NONE  # a weight at arming
    assert axis.tick(fed_back_m=-0.01, position_m=0.01, velocity_m_s=0.1) == Limit.NONE
    assert axis.tick(fed_back_m=-0.01 - 2.0 * SIGN_M, position_m=0.01, velocity_m_s=0.1) == Limit.SIGN


@BOTH
def test_a_stop_fails_where_the_axis_gets_faster_than_at_its_begin(sign: float) -> None:
    def in_stop(speed_m_s: float, planned_m_s: float = 0.5) -> Limit:
        return axis.at(sign * speed_m_s, 0.0, velocity_m_s=sign * planned_m_s, stopping=True)

    allowed_m_s = 1.25 * 0.5 + RUNAWAY_M_S
    axis = Moving()
    assert in_stop(0.5) == Limit.NONE
    assert in_stop(allowed_m_s, 0.25) == Limit.NONE
    assert in_stop(1.001 * allowed_m_s, 0.25) == Limit.STOP_FAILS
    axis = Moving()
    assert in_stop(0.5) == Limit.NONE
    assert in_stop(-(allowed_m_s - 0.5), 0.25) == Limit.NONE
    assert in_stop(-1.001 * (allowed_m_s - 0.5), 0.25) == Limit.STOP_FAILS


def test_set_points_that_still_rise_when_a_stop_begins_allow_their_speed() -> None:
    axis = Moving()
    assert axis.at(0.25, 0.0, velocity_m_s=0.25, stopping=True) == Limit.NONE
    assert axis.at(0.5, 0.0, velocity_m_s=0.5, stopping=True) == Limit.NONE
    assert axis.at(0.5, 0.0, velocity_m_s=0.25, stopping=True) == Limit.NONE


def test_a_position_error_at_the_begin_of_a_stop_allows_what_the_loop_makes_of_it() -> None:
    for error_m, passed in ((0.0, Limit.STOP_FAILS), (0.01, Limit.NONE)):
        axis = Moving(position_gain_1_s=50.0)
        assert axis.at(0.1, 0.0, velocity_m_s=0.1, position_m=error_m, stopping=True) == Limit.NONE
        assert axis.at(0.6, 0.0, velocity_m_s=0.1, stopping=True) == passed


def test_each_stop_has_its_own_begin() -> None:
    axis = Moving()
    axis.at(0.5, 0.0, velocity_m_s=0.5, stopping=True)
    assert axis.at(0.7, 0.0, velocity_m_s=0.7) == Limit.NONE
    axis.at(0.01, 0.0, velocity_m_s=0.01, stopping=True)
    assert axis.at(0.1, 0.0, velocity_m_s=0.01, stopping=True) == Limit.STOP_FAILS


# -- in runs ----------------------------------------------------------------------------------------------------------


class Backwards:
    """The plant of a drive whose phases are in the wrong order; the torque is shown as commanded."""

    def __init__(self, plant: Any) -> None:
        self._plant = plant

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    @property
    def torque_n_m(self) -> float:
        return -self._plant.torque_n_m

    def advance(self, torque_n_m: float, period_s: float) -> None:
        self._plant.advance(-torque_n_m, period_s)


def wrong_phases(rig: Rig, _: Session) -> dict:
    def turn() -> None:
        drive = rig.nodes.drive
        drive.plant = drive._loops._plant = Backwards(drive.plant)

    return {1: turn}


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
@pytest.mark.parametrize("table", [True, False])
def test_a_wrong_phase_order_shows_within_a_millimetre_and_the_power_goes_off(
    tmp_path: Path, mode: str, table: bool
) -> None:
    changes: dict[str, Any] = {} if table else {"encoders": {"table": None}}
    ran = run(tmp_path, bench_with(drive={"mode": mode}, **changes), script=wrong_phases)
    recording = ran.recording
    assert ran.outcome.ending is Ending.SIGN
    assert "feedback or torque acts with the wrong sign" in ran.outcome.reason
    assert "the drive's own stop accelerated the axis" in ran.outcome.reason
    turns = recording["motor_position_rad"] * 0.01 / (2.0 * math.pi)
    first = int((recording["drive_state"] == DriveState.QUICK_STOP_ACTIVE).argmax())
    assert abs(turns[first - 2]) < 1e-3
    assert abs(ran.rig.nodes.plant.table_position_m) < 0.025
    assert ran.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED
    assert not ran.rig.master.silent  # it obeyed "disable voltage"


@pytest.mark.parametrize("share", [-0.4, 0.4])
@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_a_vertical_axis_with_a_weight_has_no_wrong_sign(tmp_path: Path, mode: str, share: float) -> None:
    """The weight pulls from the first tick on, before the integrator of the loop holds it."""
    weight = {"effect": "external_force", "parameters": {
        "force_n": share * 12.0 * 2.0 * math.pi / 0.01, "start_s": 0.0, "end_s": 100.0}}  # fmt: skip
    bench = bench_with(drive={"mode": mode, "following_error_m": 0.02}, encoders={"table": None},
                       simulation={"effects": [weight]})  # fmt: skip
    assert run(tmp_path / "move", bench).outcome.ending is Ending.COMPLETE
    asked = run(tmp_path / "stop", bench, script=lambda _, session: {MOVING: session.ask_stop})
    assert asked.outcome.ending is Ending.INTERRUPTED
    assert DriveState.QUICK_STOP_ACTIVE not in asked.recording["drive_state"]
