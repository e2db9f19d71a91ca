"""A late loop: what the drive does meanwhile, when the axis is stopped, and with which words."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from bench_runs import MOVING, bench_with, run
from pydantic import ValidationError

from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition
from hil.bench.hardware import DriveSection
from hil.errors import FieldError
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.loop.stall import (
    LONGEST_S,
    Stall,
    command_deadline_s,
    full_torque_acceleration_m_s2,
    late_limit_s,
    stalled,
)
from hil.loop.supervision import Ending, Limit, find

ENABLING = 4  # tick at which the last controlword of the arming is on its way
WALL_CLOCK = ("time.time(", "time_ns(", "datetime.now", "datetime.today", "utcnow", "CLOCK_REALTIME", "time.ctime")


def test_full_torque_moves_the_whole_axis() -> None:
    ratio = 0.01 / (2.0 * math.pi)
    expected = 12.0 / ratio / (335.0 + 384.0)
    assert full_torque_acceleration_m_s2(bench_with()) == pytest.approx(expected)


def test_in_the_deadline_full_torque_moves_the_axis_by_its_following_error() -> None:
    bench = bench_with(drive={"mode": "cst", "following_error_m": 0.002})
    deadline_s = command_deadline_s(bench)
    moved_m = full_torque_acceleration_m_s2(bench) * deadline_s**2 / 2.0
    assert 0.9 * 0.002 < moved_m <= 0.002
    assert 1e3 * deadline_s == pytest.approx(round(1e3 * deadline_s))  # whole ms, as 0x1400:5
    assert late_limit_s(bench) == pytest.approx(deadline_s - 0.002)


def test_a_deadline_has_three_periods_and_at_most_a_twentieth_of_a_second() -> None:
    assert command_deadline_s(bench_with(drive={"mode": "cst", "following_error_m": 1e-6})) == pytest.approx(0.003)
    assert command_deadline_s(bench_with(drive={"mode": "cst", "following_error_m": 1.0})) == LONGEST_S
    assert command_deadline_s(bench_with(drive={"mode": "csv"})) == LONGEST_S  # the drive holds a speed
    assert command_deadline_s(bench_with(drive={"mode": "cst", "command_deadline_s": 0.2})) == 0.2
    patient = {"command_deadline_s": 0.2, "heartbeat_s": 0.1}
    assert late_limit_s(bench_with(drive=patient)) == 0.05  # overrun_s


def test_the_drive_has_the_deadline_of_the_bench() -> None:
    with Rig(bench_with(drive={"mode": "cst", "command_deadline_s": 0.0305})) as rig:
        rig.set_up()
        assert rig.nodes.drive.values[0x1400_05] == 30  # whole ms, never longer


def test_a_stall_shows_until_the_position_loop_has_settled() -> None:
    gains = bench_with().gains
    settled = 100 + math.floor((0.02 + 3.0 / gains.position_gain_1_s) / gains.period_s)
    stall = Stall(0.02, 0.001, 100)
    assert stall.acts(100, gains)
    assert stall.acts(settled, gains)
    assert not stall.acts(settled + 1, gains)


def test_without_a_position_loop_a_stall_shows_while_it_lasts() -> None:
    gains = bench_with().gains._replace(position_gain_1_s=0.0)
    assert Stall(0.02, 0.001, 100).acts(119, gains)
    assert not Stall(0.02, 0.001, 100).acts(121, gains)


def test_a_deadline_is_whole_milliseconds_and_at_least_three_periods() -> None:
    fast = {"velocity_period_s": 0.00025, "position_period_s": 0.001}
    deadlines_s = [
        command_deadline_s(bench_with(control=fast, drive={"mode": "cst", "command_deadline_s": given_s}))
        for given_s in (1e-4, 1.9e-3, 0.029, 0.0299999)
    ]
    assert deadlines_s == pytest.approx([0.001, 0.001, 0.029, 0.029], abs=1e-9)
    slow = {"velocity_period_s": 0.0015, "position_period_s": 0.006}
    assert command_deadline_s(bench_with(control=slow, drive={"command_deadline_s": 1e-4})) == pytest.approx(0.005)


def test_the_axis_is_stopped_two_periods_before_the_deadline_or_at_the_overrun() -> None:
    drive = {"mode": "cst", "command_deadline_s": 0.03}
    assert late_limit_s(bench_with(drive=drive | {"overrun_s": 0.05})) == pytest.approx(0.028)
    assert late_limit_s(bench_with(drive=drive | {"overrun_s": 0.02})) == pytest.approx(0.02)
    slow = {"velocity_period_s": 0.004, "position_period_s": 0.004}
    assert late_limit_s(bench_with(control=slow, drive=drive | {"overrun_s": 0.05})) == pytest.approx(0.022)


def test_the_axis_is_stopped_before_the_drive_misses_a_heartbeat() -> None:
    """Three are awaited and one may have been due: two of them less two periods, and no less than a period."""
    patient = {"command_deadline_s": 1.0, "overrun_s": 1.0}
    limits_s = [late_limit_s(bench_with(drive=patient | {"heartbeat_s": given})) for given in (0.02, 0.1, 0.001)]
    assert limits_s == pytest.approx([0.038, 0.198, 0.001])


def test_a_heartbeat_shorter_than_the_period_of_the_loop_is_refused() -> None:
    slow = {"velocity_period_s": 0.025, "position_period_s": 0.025}
    with pytest.raises(FieldError, match=r"drive.heartbeat_s: given 0.02, allowed the period of the loop.*0.025"):
        Rig(bench_with(control=slow))
    Rig(bench_with(control=slow, drive={"heartbeat_s": 0.025})).close()
    with pytest.raises(ValidationError, match="heartbeat_s"):
        DriveSection(heartbeat_s=22.0)  # three in ms do not fit the 16 bit of 0x1016


def test_a_bench_without_a_drive_has_the_values_of_the_default() -> None:
    bench = bench_with()
    bare, default = bench.model_copy(update={"drive": None}), bench.model_copy(update={"drive": DriveSection()})
    assert command_deadline_s(bare) == command_deadline_s(default)
    assert late_limit_s(bare) == late_limit_s(default)
    assert stalled(bare, 0.02, 7, 0.1) == stalled(default, 0.02, 7, 0.1)


@pytest.mark.parametrize(("mode", "held"), [("cst", True), ("csv", False)])
def test_a_stall_moves_the_axis_by_its_speed_and_by_a_torque_that_is_held(mode: str, held: bool) -> None:
    bench = bench_with(drive={"mode": mode})
    by_torque_m = full_torque_acceleration_m_s2(bench) * 0.02**2 / 2.0 if held else 0.0
    assert stalled(bench, 0.02, 7, -0.1) == (0.02, pytest.approx(0.1 * 0.02 + by_torque_m), 7)


@pytest.mark.parametrize(
    ("passed", "ending"),
    [
        (Limit.FOLLOWING_ERROR, Ending.OVERRUN),
        (Limit.VELOCITY, Ending.OVERRUN),
        (Limit.TRAVEL, Ending.OVERRUN),
        (Limit.TABLE_JUMP, Ending.ENCODER_FAULT),
        (Limit.FOLLOWING_ERROR | Limit.TABLE_JUMP, Ending.ENCODER_FAULT),
    ],
)
def test_after_a_stall_only_bounds_that_it_explains_are_told_as_a_late_loop(passed: Limit, ending: Ending) -> None:
    with Rig(bench_with()) as rig:
        seen = rig.encoder.read(0.0)._replace(condition=Condition.OK)
        stall = Stall(0.03, rig.section.following_error_m, 0)
        cause = next(iter(find(rig, seen, passed, 0.0, 0, stopping=False, stall=stall)))
        assert cause.ending is ending
        assert ("0.030 s late" in cause.reason) == (ending is Ending.OVERRUN)
        harmless = stall._replace(deviation_m=0.1 * rig.section.following_error_m)
        assert next(iter(find(rig, seen, passed, 0.0, 0, stopping=False, stall=harmless))).ending is not Ending.OVERRUN
        assert next(iter(find(rig, seen, passed, 0.0, 0, stopping=False))).ending is not Ending.OVERRUN


@pytest.mark.parametrize("lost_at", ["arming", "moving"])
def test_lost_set_points_are_no_fault_of_an_encoder(tmp_path: Path, lost_at: str) -> None:
    """Without a demand of the drive, and with a long deadline: the torque that acts does not change."""
    bus = ModelledBus()

    def lose() -> None:
        bus.inject(Fault(FaultKind.DROP, 0x205, count=100_000))

    def script(rig: Rig, session: Session) -> dict[int, object]:
        return {ENABLING if lost_at == "arming" else MOVING: lose}

    bench = bench_with(drive={"mode": "cst", "watch_setpoint": False, "command_deadline_s": 0.5})
    ran = run(tmp_path, bench, bus=bus, script=script)
    assert ran.outcome.ending in (Ending.DRIVE_FAULT, Ending.FOLLOWING_ERROR)


def test_no_module_of_a_run_reads_the_wall_clock() -> None:
    """CLOCK_REALTIME may step: a run's ticks, time-outs and rows depend on the monotonic clock alone."""
    root = Path(__file__).parents[3]
    folders = (root / "drivers", root / "hil" / "loop", root / "hil" / "recording", root / "hil" / "control")
    sources = [path for folder in folders for path in folder.rglob("*.py")]
    assert len(sources) > 50
    found = [f"{path.name}: {word}" for path in sources for word in WALL_CLOCK if word in path.read_text("utf-8")]
    assert not found
