"""Arming and stopping in virtual time: a drive that does not hear or obey is stopped, and off or said not to be."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_runs import MOVE, MOVING, Ran, bench_with, run

from drivers.bus import BusState
from drivers.cia402 import DriveState
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition
from drivers.sdo_setup import EDS_FOLDER
from hil.errors import HilError, StillPowered
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.loop.supervision import Ending
from hil.motion.trajectory import plan
from hil.recording.recording import read_recording

RPDO, DRIVE_TPDO = 0x205, 0x185
MANY = 1_000_000
SPEED_M_S, DECELERATION_M_S2 = 0.1, 160 * 0.01  # of the move; 160 rev/s^2, the default of 0x6085, on a lead of 10 mm
RAMP_M = SPEED_M_S**2 / (2 * DECELERATION_M_S2)
DEADLINE_S = 0.05  # of the RPDO
ARMING = 3  # a tick before the drive is enabled


class Bench:
    """A run whose rig is kept, and the plant's true motion, whatever the run ends with."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.bus = folder, ModelledBus()
        self.rig: Rig | None = None

    def run(self, bench: Any, events: Callable[[Rig, Session], dict[int, Callable[[], Any]]]) -> Ran:
        def script(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
            self.rig = rig
            return events(rig, session)

        return run(self.folder, bench, script=script, bus=self.bus)

    def lose(self, can_id: int) -> None:
        self.bus.inject(Fault(FaultKind.DROP, can_id, count=MANY))

    @property
    def ended(self) -> str:
        return read_recording(self.folder / "run.parquet").metadata["ended"]

    @property
    def travelled_m(self) -> float:
        """Way of the table from the recording's row MOVING to the end of everything."""
        recording = read_recording(self.folder / "run.parquet")
        return abs(self.rig.nodes.plant.table_position_m - recording["table_position_m"][MOVING])

    def speed_m_s(self) -> float:
        """Mean speed of the table over the next 100 periods of the drive's own clock."""
        drive, plant = self.rig.nodes.drive, self.rig.nodes.plant
        before_m = plant.table_position_m
        for _ in range(100):
            drive._move(0.0)
        return abs(plant.table_position_m - before_m) / 0.1


@pytest.fixture
def at(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def without_deadline(folder: Path) -> str:
    """EDS of a drive that has no event timer of its RPDO."""
    text = (EDS_FOLDER / "servo_drive.eds").read_text()
    begin = text.index("[1400sub5]")
    path = folder / "no_deadline.eds"
    path.write_text(text[:begin] + text[text.index("[1401]", begin) :])
    return str(path)


# -- the command path is lost -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_lost_set_points_stop_the_axis_within_deadline_and_ramp(at: Bench, mode: str) -> None:
    ran = at.run(bench_with(drive={"mode": mode}), lambda *_: {MOVING: lambda: at.lose(RPDO)})
    assert at.rig.nodes.drive.state is DriveState.FAULT
    assert at.travelled_m < SPEED_M_S * (DEADLINE_S + 0.01) + RAMP_M
    assert at.speed_m_s() < 1e-4
    assert ran.outcome.ending in (Ending.DRIVE_FAULT, Ending.FOLLOWING_ERROR)


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_without_a_deadline_in_the_drive_the_unanswered_quick_stop_cuts_it_off(at: Bench, mode: str) -> None:
    bench = bench_with(drive={"mode": mode, "eds": without_deadline(at.folder)})
    ran = at.run(bench, lambda *_: {MOVING: lambda: at.lose(RPDO)})
    assert not ran.rig.drive.info.supervises_commands
    assert ran.rig.drive.tripped & Condition.UNANSWERED
    assert "did not follow its controlword" in ran.outcome.reason
    assert ran.outcome.ending is Ending.FOLLOWING_ERROR
    assert ran.rig.nodes.drive.state is DriveState.FAULT
    assert at.speed_m_s() < 1e-4


def test_the_cut_takes_place_a_few_cycles_after_the_quick_stop(at: Bench) -> None:
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


def test_cut_off_master_sends_nothing_that_feeds_a_watchdog(at: Bench) -> None:
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
def test_a_drive_that_ignores_controlwords_at_the_end_is_cut_off(at: Bench, mode: str) -> None:
    """The profile is done, the axis at rest, and the drive hears no controlword: its watchdog switches it off."""
    last = len(plan(MOVE, 1e-3, 0.0)) - 5

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        return {last: lambda: setattr(rig.nodes.drive, "_take_controlword", lambda now_s: None)}

    ran = at.run(bench_with(drive={"mode": mode}), events)
    assert ran.rig.nodes.drive.state is DriveState.FAULT
    assert "did not follow its controlword" in ran.outcome.reason


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
@pytest.mark.parametrize("end", ["profile", "exception"])
def test_a_drive_that_stays_on_is_an_error(at: Bench, mode: str, end: str) -> None:
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


def test_a_drive_that_reports_no_state_any_more_is_not_taken_for_off(at: Bench) -> None:
    with pytest.raises(StillPowered, match="UNKNOWN"):
        at.run(bench_with(), lambda rig, _: {MOVING: lambda: _answer_always(rig, 0x0202)})


def _answer_always(rig: Rig, statusword: int) -> None:
    """The statusword stays the same in TPDO and SDO."""
    rig.nodes.drive._status = lambda extra: None
    rig.nodes.drive.values[0x6041_00] = statusword


def test_no_signal_ends_the_switching_off(at: Bench) -> None:
    last = len(plan(MOVE, 1e-3, 0.0)) + 7

    def events(_: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        return dict.fromkeys(range(last, last + 3), lambda: [session.ask_stop() for _ in range(3)] and 0.0)

    ran = at.run(bench_with(), events)
    assert ran.outcome.ending is Ending.COMPLETE
    assert ran.rig.nodes.drive.state is DriveState.READY_TO_SWITCH_ON


def test_third_ctrl_c_ends_the_run_at_once_with_power_off(at: Bench) -> None:
    with pytest.raises(KeyboardInterrupt):
        at.run(bench_with(), lambda _, session: {MOVING + 5 * k: session.ask_stop for k in range(3)})
    assert at.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED


# -- arming -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_a_passive_bus_while_arming_does_not_hide_a_drive_that_switches_off(at: Bench, mode: str) -> None:
    def passive(rig: Rig) -> None:
        rig.master.health.state = BusState.PASSIVE

    def off(rig: Rig) -> None:
        rig.nodes.drive.values[0x6007_00] = 2  # power off without a fault
        rig.nodes.drive.communication_lost(0.001 * MOVING)

    ran = at.run(bench_with(drive={"mode": mode}), lambda rig, _: {1: lambda: passive(rig), MOVING: lambda: off(rig)})
    assert ran.outcome.ending is Ending.DRIVE_FAULT
    assert "DISABLED" in ran.outcome.reason
    states = ran.recording["drive_state"]
    left = int(np.argmax(states != DriveState.OPERATION_ENABLED))
    assert DriveState.OPERATION_ENABLED not in states[left:]


def test_an_axis_that_moves_while_the_drive_is_armed_is_not_started(at: Bench) -> None:
    bench = bench_with(drive={"mode": "cst", "following_error_m": 0.001})

    def push(rig: Rig) -> None:
        plant = rig.nodes.plant
        plant.reset(0.002)
        rig.nodes.drive._measure(round(plant.motor_position_rad * rig.nodes.drive._counts_per_rad))

    with pytest.raises(HilError, match=r"the axis stands at 0.002.*begin at 0.000000 m: it moved"):
        at.run(bench, lambda rig, _: {ARMING: lambda: push(rig)})
    assert at.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED
    assert not (at.folder / "run.parquet").exists()  # not one row


def test_a_stale_sample_does_not_arm(at: Bench) -> None:
    """A drive that was enabled at the end of its set-up and gives no answer to the first SYNCs."""

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        rig.drive._statusword = 0x0237
        at.bus.inject(Fault(FaultKind.DROP, DRIVE_TPDO, count=2))
        return {}

    with pytest.raises(HilError, match="DISABLED"):  # the first answer says that it is not enabled any more
        at.run(bench_with(), events)
    assert not (at.folder / "run.parquet").exists()


def test_a_drive_that_stays_enabled_in_its_set_up_is_refused(at: Bench) -> None:
    with Rig(bench_with(), bus=at.bus) as rig:
        drive = rig.nodes.drive
        rig.set_up()
        drive._set_state(DriveState.OPERATION_ENABLED)
        drive._take_controlword = lambda now_s: None
        drive.dictionary.on_write(0x6060, lambda index, subindex, value: None)  # takes any mode in any state
        with pytest.raises(HilError, match=r"power stage is still on.*OPERATION_ENABLED"):
            rig.set_up()


def test_a_fault_while_arming_is_not_armed_over(at: Bench) -> None:
    """An EMCY that leaves the drive enabled: the run does not begin."""
    with pytest.raises(HilError, match="EMERGENCY"):
        at.run(bench_with(), lambda rig, _: {ARMING: lambda: rig.nodes.drive.emergency(0x4310, 0x09, 0.003)})
    assert not (at.folder / "run.parquet").exists()  # not one row
    assert at.rig.nodes.drive.state is DriveState.SWITCH_ON_DISABLED


@pytest.mark.parametrize("mode", ["cst", "csv", "csp"])
def test_targets_are_the_actual_values_until_the_drive_is_enabled(at: Bench, mode: str) -> None:
    heard: list[tuple[int, int]] = []

    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        drive = rig.nodes.drive
        drive.values[0x6071_00] = drive.values[0x60FF_00] = drive.values[0x607A_00] = 30_000  # left over

        def listen(can_id: int, data: bytes, now_s: float) -> None:
            if drive.state is not DriveState.OPERATION_ENABLED:
                counts = int.from_bytes(data[2:], "little", signed=True)
                heard.append((counts, drive.values[0x6064_00] if mode == "csp" else 0))

        drive.port.listen(RPDO, listen)
        return {}

    at.run(bench_with(drive={"mode": mode}), events)
    assert len(heard) > 3
    assert all(abs(sent - actual) <= 1 for sent, actual in heard)


def test_quick_stop_keeps_to_the_torque_limit(at: Bench) -> None:
    limit_n_m = 0.5
    torques: list[float] = []

    def events(rig: Rig, session: Session) -> dict[int, Callable[[], Any]]:
        def stop() -> None:
            rig.nodes.drive.values[0x6072_00] = round(limit_n_m * rig.nodes.drive._mille_per_n_m)
            session.ask_stop()
            session.ask_stop()

        watch = {MOVING + k: lambda: torques.append(rig.nodes.plant.torque_n_m) and 0.0 for k in range(3, 200)}
        return watch | {MOVING: stop}

    ran = at.run(bench_with(simulation={"sensors": {"torque_noise_n_m": 0.0}}), events)
    assert DriveState.QUICK_STOP_ACTIVE in ran.recording["drive_state"]
    assert 0.9 * limit_n_m < np.abs(torques).max() < 1.01 * limit_n_m


def test_dead_man_times_and_stop_reactions_are_in_the_drive(at: Bench) -> None:
    def events(rig: Rig, _: Session) -> dict[int, Callable[[], Any]]:
        number = rig.nodes.drive.dictionary.number
        assert number(0x1400, 5) == 50
        assert number(0x1016, 1) == 1 << 16 | 60
        assert number(0x1017) == 20
        assert number(0x1006) == 1000
        assert [number(index) for index in (0x605A, 0x605E, 0x6007)] == [2, 2, 1]
        assert number(0x1600) == 2
        assert [number(0x1600, k) for k in (1, 2)] == [0x60400010, 0x60710010]
        return {}

    # as another tool left them: coast at quick stop, nothing at a lost master
    bench = bench_with()
    defaults = {0x605A: 0, 0x605E: 0, 0x6007: 0}
    with Rig(bench, bus=at.bus) as rig:
        rig.nodes.drive.values.update({index << 8: value for index, value in defaults.items()})
        rig.set_up()
        events(rig, None)
