"""Heartbeats, NMT and the trial of the drive's heartbeat consumer, frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from drive_rig import Rig, in_process, running, servo
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus import CanPort
from drivers.canopen_drive import DriveSettings
from drivers.canopen_master import NMT_PRE_OPERATIONAL, NMT_START, NMT_STOP, CanopenMaster
from drivers.cia402 import DriveState
from drivers.heartbeat_trial import watches_master
from drivers.inprocess import InProcessBus
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition, DriveGoal
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup

MASTER, DRIVE, NMT, EMCY = 0x701, 0x705, 0x000, 0x085
PERIOD_S = 0.001


def heard(port: CanPort, can_id: int) -> list[tuple[float, bytes]]:
    frames: list[tuple[float, bytes]] = []
    port.listen(can_id, lambda _, data, now_s: frames.append((now_s, data)))
    return frames


# -- of a node --------------------------------------------------------------------------------------------------------


def test_what_is_no_heartbeat_keeps_no_node_alive() -> None:
    """Without bytes, with two, or with a state that CiA 301 does not have: as one that does not come."""
    bus, rig = running()
    other, frames = bus.port(), (b"", b"\x05\x05", b"\x06", b"\x85", b"\xff")
    rig.node.values[0x1017_00] = 0  # it sends none itself
    conditions = []
    for k in range(90):
        other.send(DRIVE, frames[k % len(frames)], rig.now_s)
        conditions.append(rig.cycle().condition)
    assert 40 <= conditions.index(Condition.HEARTBEAT_LOST) <= 61
    assert set(conditions[:40]) == {Condition.OK}
    assert rig.drive.malformed_frames == 90


@given(st.binary(max_size=8))
def test_a_heartbeat_is_one_byte_with_a_state_of_cia_301(data: bytes) -> None:
    rig = Rig(*(lambda bus: (bus.port(), bus.port()))(InProcessBus()))
    rig.drive._answered = rig.drive._set_up_at - 1  # as after the first answer to a SYNC
    rig.drive._on_heartbeat(DRIVE, data, 7.0)
    valid = data in (b"\x00", b"\x04", b"\x05", b"\x7f")
    assert rig.drive.malformed_frames == (not valid)
    assert (rig.drive._heartbeat_deadline_s == 7.06) == valid
    assert bool(rig.drive._latched & Condition.NOT_OPERATIONAL) == (valid and data != b"\x05")


@pytest.mark.parametrize("state", [b"\x00", b"\x04", b"\x7f"])
def test_a_node_that_boots_or_leaves_operational_stops_the_axis(state: bytes) -> None:
    bus, rig = running()
    bus.port().send(DRIVE, state, rig.now_s)
    conditions = [rig.cycle().condition for _ in range(2)]
    assert conditions[-1] & Condition.NOT_OPERATIONAL
    assert rig.drive.goal is DriveGoal.QUICK_STOP


# -- of the master ----------------------------------------------------------------------------------------------------


def test_heartbeats_that_a_late_loop_missed_are_not_sent_afterwards() -> None:
    bus = InProcessBus()
    master = CanopenMaster(bus.port(), heartbeat_s=0.02)
    beats = heard(bus.port(), MASTER)
    master.start(0.0)
    for tick in (*range(1, 30), *range(500, 561)):
        master.sync(tick * PERIOD_S)
    assert [round(1e3 * now_s) for now_s, _ in beats] == [0, 20, 500, 520, 540, 560]


def test_a_heartbeat_that_is_due_when_a_missed_one_is_sent_goes_with_it() -> None:
    bus = InProcessBus()
    master = CanopenMaster(bus.port(), heartbeat_s=0.25)
    beats = heard(bus.port(), MASTER)
    master.start(0.0)
    for now_s in (0.5, 0.625, 0.75):
        master.sync(now_s)
    assert [now_s for now_s, _ in beats] == [0.0, 0.5, 0.75]


def test_a_period_that_is_no_multiple_of_the_tick_is_kept_on_average() -> None:
    bus = InProcessBus()
    master = CanopenMaster(bus.port(), heartbeat_s=0.0025)
    beats = heard(bus.port(), MASTER)
    master.start(0.0)
    for tick in range(1, 11):
        master.sync(tick * PERIOD_S)
    assert [round(1e3 * now_s) for now_s, _ in beats] == [0, 3, 5, 8, 10]


def test_a_master_that_is_cut_off_repeats_nmt_stop_and_sends_nothing_else() -> None:
    bus = InProcessBus()
    master = CanopenMaster(bus.port(), heartbeat_s=0.002)
    everything: list[tuple[int, bytes]] = []
    master.start(0.0)
    bus.port().listen(None, lambda can_id, data, now_s: everything.append((can_id, data)))
    master.cut_off(0.001)
    for tick in range(1, 21):
        master.sync(tick * PERIOD_S)
    assert everything == [(NMT, bytes([NMT_STOP, 0]))] * 21  # the first may have been lost
    assert master.syncs == 20  # samples grow old


def test_a_drive_that_is_released_awaits_no_heartbeat_and_is_pre_operational() -> None:
    rig = in_process()
    rig.set_up()
    assert rig.node.values[0x1016_01]
    rig.master.release(5)
    assert rig.node.values[0x1016_01] == 0
    assert rig.node.nmt_state == 127


def test_nmt_stop_that_is_lost_at_first_still_stops_the_drive() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, NMT, count=5))
    rig.master.cut_off(rig.now_s)
    for _ in range(10):
        rig.cycle()
    assert rig.node.state in (DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT)


# -- the trial at set-up ----------------------------------------------------------------------------------------------


def tried(change: Callable[[Rig, ModelledBus], Any] = lambda rig, bus: None) -> Rig:
    """A rig that is set up, whose drive has its own clock."""
    bus = ModelledBus(1_000_000)
    rig = Rig(bus.port(), bus.port(), servo=servo(), reply_s=0.0006)
    bus.clocks.append(rig.node.clock)
    change(rig, bus)
    rig.set_up()
    return rig


def test_a_drive_that_misses_the_master_shows_it_at_set_up() -> None:
    states: list[DriveState] = []

    def watch(rig: Rig, bus: ModelledBus) -> None:
        set_state = rig.node._set_state
        rig.node._set_state = lambda state: (states.append(state), set_state(state))
        rig.node.values[0x6007_00] = 1  # left by the run before

    rig = tried(watch)
    assert DriveState.FAULT not in states  # without a reaction
    assert rig.drive.info.watches_master
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED
    assert rig.node.values[0x1016_01] == 1 << 16 | 60
    assert rig.node.values[0x6007_00] == 1
    assert rig.drive.emergencies == []
    assert rig.enable().condition is Condition.OK
    for _ in range(200):
        rig.cycle()
    rig.drive.goal = DriveGoal.DISABLED
    for _ in range(5):
        rig.cycle()
    rig.set_up()  # the time of the set-up is another one
    assert rig.drive.info.watches_master


@pytest.mark.parametrize("lost", [MASTER, EMCY])
def test_a_drive_that_gets_no_heartbeat_or_does_not_report_is_seen(lost: int) -> None:
    rig = tried(lambda rig, bus: bus.inject(Fault(FaultKind.DROP, lost, count=100)))
    assert not rig.drive.info.watches_master


def test_a_drive_that_watches_another_node_is_seen() -> None:
    def listen_to_nobody(rig: Rig, bus: ModelledBus) -> None:
        rig.node._on_heartbeat = lambda can_id, data, now_s: None

    assert not tried(listen_to_nobody).drive.info.watches_master


@pytest.mark.parametrize("code", [0x4210, 0x80FF, 0x8210, 0x9000, 0xFF01])
def test_another_emergency_is_no_report(code: int) -> None:
    """0x81xx is communication (CiA 301); heat, a PDO of another length, the device's own are not."""

    def trips(rig: Rig, bus: ModelledBus) -> None:
        rig.node._on_heartbeat = lambda can_id, data, now_s: rig.node.emergency(code, 0x09, now_s)

    assert not tried(trips).drive.info.watches_master


def test_a_consumer_without_an_entry_is_not_tried(tmp_path: Path) -> None:
    text = (EDS_FOLDER / "servo_drive.eds").read_text()
    (tmp_path / "drive.eds").write_text(text[: text.index("[1016sub1]")] + text[text.index("[1017]") :])
    rig = in_process(settings=DriveSettings(eds=tmp_path / "drive.eds"))
    with DeviceSetup(rig.master.network, 5, tmp_path / "drive.eds") as device:
        assert watches_master(device, rig.master) is None


def test_a_report_is_waited_for_a_fifth_of_a_second() -> None:
    commands: list[tuple[float, bytes]] = []

    def deaf(rig: Rig, bus: ModelledBus) -> None:
        bus.inject(Fault(FaultKind.DROP, MASTER, count=100))
        rig.master.network.time_s = 0.5
        bus.port().listen(NMT, lambda _, data, now_s: commands.append((now_s, data)))

    tried(deaf)
    began = next(k for k, (_, data) in enumerate(commands) if data == bytes([NMT_START, 5]))
    (begin_s, _), (end_s, ended) = commands[began : began + 2]
    assert ended == bytes([NMT_PRE_OPERATIONAL, 5])
    assert end_s - begin_s == pytest.approx(0.2, abs=0.003)


def test_a_drive_that_faults_whatever_its_option_is_reset() -> None:
    """0x6007 = 0 asks for no reaction; some react. A fault of before stays."""

    def faults(rig: Rig, bus: ModelledBus) -> None:
        rig.node.communication_lost = lambda now_s: rig.node._set_state(DriveState.FAULT)

    rig = tried(faults)
    assert rig.drive.info.watches_master
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED
    latched = tried(lambda rig, bus: (faults(rig, bus), rig.node._set_state(DriveState.FAULT)))
    assert latched.node.state is DriveState.FAULT
