"""Stopping in virtual time: a drive that does not hear or obey is stopped, and off or said not to be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bench_runs import MOVE, MOVING, bench_with, run
from faulty_bench import FaultyBench
from typer.testing import CliRunner

from drivers.cia402 import DriveState
from drivers.port import Condition, DriveGoal
from drivers.sdo_setup import EDS_FOLDER
from drivers.sim.drive_node import SimulatedDrive
from hil.cli import app
from hil.errors import StillPowered
from hil.loop.devices import Rig
from hil.loop.session import DISARM_TIMEOUT_S, Session
from hil.loop.supervision import Ending
from hil.motion.profile import Profile
from hil.motion.trajectory import plan

RPDO = 0x205
PROFILE = Path(__file__).parents[3] / "profiles" / "friction_sweep.yaml"
SPEED_M_S, DECELERATION_M_S2 = 0.1, 160 * 0.01  # of the move; 160 rev/s^2, the default of 0x6085, on a lead of 10 mm
RAMP_M = SPEED_M_S**2 / (2 * DECELERATION_M_S2)
DEADLINE_S = 0.05  # of the RPDO


@pytest.fixture
def at(tmp_path: Path) -> FaultyBench:
    return FaultyBench(tmp_path)


def without_deadline(folder: Path) -> str:
    """EDS of a drive that has no event timer of its RPDO."""
    text = (EDS_FOLDER / "servo_drive.eds").read_text()
    begin = text.index("[1400sub5]")
    path = folder / "no_deadline.eds"
    path.write_text(text[:begin] + text[text.index("[1401]", begin) :])
    return str(path)


# -- the command path is lost -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_lost_set_points_stop_the_axis_within_deadline_and_ramp(at: FaultyBench, mode: str) -> None:
    ran = at.run(bench_with(drive={"mode": mode}), lambda *_: {MOVING: lambda: at.lose(RPDO)})
    assert at.rig.nodes.drive.state is DriveState.FAULT
    assert at.travelled_m < SPEED_M_S * (DEADLINE_S + 0.01) + RAMP_M
    assert at.speed_m_s() < 1e-4
    assert ran.outcome.ending in (Ending.DRIVE_FAULT, Ending.FOLLOWING_ERROR)


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_without_a_deadline_in_the_drive_the_unanswered_quick_stop_cuts_it_off(at: FaultyBench, mode: str) -> None:
    bench = bench_with(drive={"mode": mode, "eds": without_deadline(at.folder), "watch_setpoint": False})
    ran = at.run(bench, lambda *_: {MOVING: lambda: at.lose(RPDO)})
    assert not ran.rig.drive.info.supervises_commands
    assert ran.rig.drive.tripped & Condition.UNANSWERED
    assert "did not follow its controlword" in ran.outcome.reason
    # torque is compared with its command at once, position with its set-point only once it is far away
    assert ran.outcome.ending is (Ending.DRIVE_FAULT if mode == "cst" else Ending.FOLLOWING_ERROR)
    assert ran.rig.nodes.drive.state is DriveState.FAULT
    assert at.speed_m_s() < 1e-4


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_a_drive_that_reports_its_demand_is_seen_to_get_no_set_points(at: FaultyBench, mode: str) -> None:
    bench = bench_with(drive={"mode": mode, "eds": without_deadline(at.folder)})
    ran = at.run(bench, lambda *_: {MOVING: lambda: at.lose(RPDO)})
    assert ran.outcome.ending is Ending.DRIVE_FAULT
    assert ran.rig.drive.tripped & Condition.OTHER_SETPOINT
    assert "acts, commanded were" in ran.outcome.reason
    assert ran.rig.nodes.drive.state is DriveState.FAULT
    assert at.speed_m_s() < 1e-4


def test_the_cut_takes_place_a_few_cycles_after_the_quick_stop(at: FaultyBench) -> None:
    stopped: list[int] = []

    def events(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        def lose_commands() -> None:
            for can_id in (0x000, RPDO, 0x605):  # only what the master does is looked at
                at.lose(can_id)
            session.ask_stop()
            session.ask_stop()

        quick = {MOVING: lose_commands}
        return quick | {MOVING + k: lambda k=k: stopped.append(k) if rig.master.silent else None for k in range(1, 99)}

    with pytest.raises(StillPowered):
        at.run(bench_with(drive={"eds": without_deadline(at.folder), "heartbeat_s": 5.0}), events)
    assert 5 <= stopped[0] <= 15


@pytest.mark.parametrize("mode", ["cst", "csv"])
def test_while_power_is_switched_off_zero_is_commanded(at: FaultyBench, mode: str) -> None:
    commanded: list[float] = []

    def watch(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        command = rig.drive.command

        def seen(now_s: float, value: float) -> None:
            if rig.drive.goal is DriveGoal.DISABLED:  # the power is switched off
                commanded.append(value)
            command(now_s, value)

        return {MOVING: lambda: setattr(rig.drive, "command", seen)}

    assert at.run(bench_with(drive={"mode": mode}), watch).outcome.ending is Ending.COMPLETE
    assert commanded
    assert set(commanded) == {0.0}


def test_a_drive_that_never_answers_is_asked_for_a_fifth_of_a_second_only(at: FaultyBench) -> None:
    """A ramp is waited for only if the drive has said that it brakes."""
    switching_off: list[float] = []

    def deafen(rig: Rig, session: Session) -> None:
        for can_id in (0x185, 0x285):
            at.lose(can_id)
        read = rig.drive.read

        def seen(now_s: float) -> Any:
            if rig.drive.goal is DriveGoal.DISABLED:  # the power is switched off
                switching_off.append(now_s)
            return read(now_s)

        rig.drive.read = seen

    at.run(bench_with(), lambda rig, session: {MOVING: lambda: deafen(rig, session)})
    assert DISARM_TIMEOUT_S - 0.01 < switching_off[-1] - switching_off[0] < DISARM_TIMEOUT_S + 0.01


def test_cut_off_master_sends_nothing_that_feeds_a_watchdog(at: FaultyBench) -> None:
    sent: list[int] = []

    def deafen(rig: Rig, session: Session) -> None:
        drive = rig.nodes.drive
        drive._take_controlword = lambda now_s: None
        drive.communication_lost = lambda now_s: None
        session.ask_stop()
        session.ask_stop()
        drive.port.listen(None, lambda can_id, data, now_s: sent.append(can_id) if rig.master.silent else None)

    with pytest.raises(StillPowered, match=r"still reports OPERATION_ENABLED.*: switch it off at the mains"):
        at.run(bench_with(), lambda rig, session: {MOVING: lambda: deafen(rig, session)})
    assert set(sent) == {0x000, 0x605}  # NMT, and the question of `confirm_off`
    assert at.ended == "StillPowered"


# -- power off --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_a_drive_that_ignores_controlwords_at_the_end_is_cut_off(at: FaultyBench, mode: str) -> None:
    """The profile is done, the axis at rest, and the drive hears no controlword: its watchdog switches it off."""
    last = len(plan(MOVE, 1e-3, 0.0)) - 5

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        return {last: lambda: setattr(rig.nodes.drive, "_take_controlword", lambda now_s: None)}

    ran = at.run(bench_with(drive={"mode": mode}), events)
    assert ran.rig.nodes.drive.state is DriveState.FAULT
    assert ran.outcome.ending is Ending.DRIVE_FAULT
    assert "did not follow its controlword" in ran.outcome.reason


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
@pytest.mark.parametrize("end", ["profile", "exception"])
def test_a_drive_that_stays_on_is_an_error(at: FaultyBench, mode: str, end: str) -> None:
    def deafen(rig: Rig) -> None:
        rig.nodes.drive._take_controlword = lambda now_s: None
        rig.nodes.drive.communication_lost = lambda now_s: None
        if end == "exception":
            raise ZeroDivisionError("a bug")

    with pytest.raises(StillPowered, match=r"^The drive still reports OPERATION_ENABLED.*: switch it off") as caught:
        at.run(bench_with(drive={"mode": mode}), lambda rig, _: {MOVING: lambda: deafen(rig)})
    assert caught.value.exit_code == 3
    assert (Ending.COMPLETE if end == "profile" else "ZeroDivisionError: a bug") in str(caught.value)
    assert at.ended == "StillPowered"


@pytest.mark.parametrize(("requests", "slower"), [(0, 1), (3, 1), (0, 4)])
def test_the_ramp_of_the_drive_is_not_cut_off_by_the_end_of_a_run(tmp_path: Path, requests: int, slower: int) -> None:
    """An exception, or a third ctrl-C, at 0.5 m/s: the ramp takes 0.3 or 1.2 s. Without power it would coast."""
    rigs: list[Rig] = []
    motion = MOVE.model_dump()
    motion["segments"][1].update(to_m=0.3, feed_m_s=0.5)

    def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        def fail() -> None:
            for _ in range(requests):
                session.ask_stop()
            if not requests:
                raise ZeroDivisionError

        rigs.append(rig)
        rig.nodes.drive.values[0x6085_00] //= slower
        rig.drive.info = replace(rig.drive.info, quick_stop_rad_s2=rig.drive.info.quick_stop_rad_s2 / slower)
        return {500: fail}

    with pytest.raises(KeyboardInterrupt if requests else ZeroDivisionError):
        run(tmp_path, script=script, profile=Profile.model_validate(motion))
    plant = rigs[0].nodes.plant
    before_m = plant.table_position_m
    plant.advance(0.0, 0.001)
    assert abs(plant.table_position_m - before_m) < 0.01 * 0.001  # 10 mm/s: the end of the ramp
    assert rigs[0].nodes.drive.state is DriveState.SWITCH_ON_DISABLED


def test_a_drive_that_reports_no_state_any_more_is_not_taken_for_off(at: FaultyBench) -> None:
    with pytest.raises(StillPowered, match="UNKNOWN"):
        at.run(bench_with(), lambda rig, _: {MOVING: lambda: _answer_always(rig, 0x0202)})


def _answer_always(rig: Rig, statusword: int) -> None:
    """The statusword stays the same in TPDO and SDO."""
    rig.nodes.drive._status = lambda extra: None
    rig.nodes.drive.values[0x6041_00] = statusword


def test_no_signal_ends_the_switching_off(at: FaultyBench) -> None:
    last = len(plan(MOVE, 1e-3, 0.0)) + 7

    def events(_: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        return dict.fromkeys(range(last, last + 3), lambda: [session.ask_stop() for _ in range(3)] and 0.0)

    ran = at.run(bench_with(), events)
    assert ran.outcome.ending is Ending.COMPLETE
    assert ran.rig.nodes.drive.state is DriveState.READY_TO_SWITCH_ON


def test_third_ctrl_c_ends_the_run_at_once_with_power_off(at: FaultyBench) -> None:
    with pytest.raises(KeyboardInterrupt):
        at.run(bench_with(), lambda _, session: {MOVING + 5 * k: session.ask_stop for k in range(3)})
    assert at.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED


def test_the_command_line_says_that_power_is_on(monkeypatch: pytest.MonkeyPatch, at: FaultyBench) -> None:
    """A drive that enables and then hears nothing any more, from set-up to the end of `hil run`."""

    def enable_only(drive: SimulatedDrive, now_s: float) -> None:
        order = [DriveState.SWITCH_ON_DISABLED, *range(DriveState.READY_TO_SWITCH_ON, DriveState.QUICK_STOP_ACTIVE)]
        heard = drive.values[0x6040_00] == 0x0F or drive.state in order[:2]
        if heard and drive.state in order[:3] and drive.values[0x6040_00]:
            drive._set_state(DriveState(order[order.index(drive.state) + 1]))

    monkeypatch.setattr(SimulatedDrive, "_take_controlword", enable_only)
    monkeypatch.setattr(SimulatedDrive, "communication_lost", lambda drive, now_s: None)
    result = CliRunner().invoke(app, ["run", str(PROFILE), "--virtual", "--out", str(at.folder)])
    assert isinstance(result.exception, StillPowered)
    assert result.exception.exit_code == 3
