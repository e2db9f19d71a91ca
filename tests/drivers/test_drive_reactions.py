"""Set-up of the reactions of a drive: cycle time, quick stop and fault reaction, watchdogs, fault reset."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from drive_rig import Rig, in_process, servo

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState, OperationMode
from drivers.cia402_watchdogs import Watchdogs, write_reactions, write_timing, write_watchdogs
from drivers.fault_reset import reset_fault
from drivers.inprocess import InProcessBus
from drivers.port import Condition, ConfigurationError
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup
from drivers.sim.sdo_server import AbortCode, SdoAbort, SdoServer

CST, CSP = OperationMode.CYCLIC_SYNC_TORQUE, OperationMode.CYCLIC_SYNC_POSITION
CONSUMER, DEADLINE = 0x1016_01, 0x1400_05


@pytest.fixture
def rig() -> Rig:
    return in_process()


@pytest.fixture
def device(rig: Rig) -> Iterator[DeviceSetup]:
    with DeviceSetup(rig.master.network, 5, EDS_FOLDER / "servo_drive.eds") as setup:
        yield setup


def keep(rig: Rig, key: int, value: int) -> None:
    """Let the drive have a value and refuse another."""

    def refuse(index: int, subindex: int, wanted: int) -> None:
        if index << 8 | subindex == key:
            raise SdoAbort(AbortCode.READ_ONLY)

    rig.node.values[key] = value
    rig.node.dictionary.on_write(key >> 8, refuse)


# -- watchdogs --------------------------------------------------------------------------------------------------------


def test_watchdogs_are_written_in_their_units(rig: Rig, device: DeviceSetup) -> None:
    assert write_watchdogs(device, 3, 0.06, 0.02, 0.0235) == Watchdogs(0.02, True)
    assert [rig.node.values[key] for key in (CONSUMER, 0x1017_00, DEADLINE)] == [3 << 16 | 60, 20, 23]
    assert device.kept == []
    write_watchdogs(device, 3, 0.06, 0.02, 1e-4)
    assert rig.node.values[DEADLINE] == 1


@pytest.mark.parametrize(("held", "watches"), [
    (1 << 16 | 60, True), (0x81 << 16 | 500, True), (2 << 16 | 60, False), (0 << 16 | 60, False), (3 << 16 | 60, False),
    (1 << 16, False), (0, False),
])  # fmt: skip
def test_a_consumer_that_the_drive_keeps_must_await_this_master(
    rig: Rig, device: DeviceSetup, held: int, watches: bool
) -> None:
    keep(rig, CONSUMER, held)
    assert write_watchdogs(device, 1, 0.07, 0.02, 0.05).supervises_commands  # the deadline is enough
    assert len(device.kept) == 1
    keep(rig, DEADLINE, 0)
    if watches:
        assert not write_watchdogs(device, 1, 0.07, 0.02, 0.05).supervises_commands
        return
    message = (
        rf"commands stop.*given: 0x1016:01 \(.*\) {held} instead of 65606, 0x1400:05 \(.*\) 0 instead of 50; allowed"
    )
    with pytest.raises(ConfigurationError, match=message):
        write_watchdogs(device, 1, 0.07, 0.02, 0.05)


@pytest.mark.parametrize(("sent_ms", "heartbeat_s"), [(100, 0.1), (0, float("inf"))])
def test_a_heartbeat_is_awaited_as_the_drive_keeps_it(
    rig: Rig, device: DeviceSetup, sent_ms: int, heartbeat_s: float
) -> None:
    keep(rig, 0x1017_00, sent_ms)
    assert write_watchdogs(device, 1, 0.06, 0.02, 0.05).heartbeat_s == heartbeat_s


def test_a_drive_with_the_deadline_alone_stops_when_its_master_is_gone(tmp_path: Path) -> None:
    """No 0x1016: nothing is tried at the set-up, and what the drive does then rests on 0x1400:5 and 0x6007."""
    text = (EDS_FOLDER / "servo_drive.eds").read_text()
    (tmp_path / "drive.eds").write_text(text[: text.index("[1016]")] + text[text.index("[1017]") :])
    bus = InProcessBus()
    rig = Rig(bus.port(), bus.port(), servo=servo(), settings=DriveSettings(eds=tmp_path / "drive.eds"))
    rig.set_up()
    assert rig.drive.info.supervises_commands
    assert rig.drive.info.watches_master  # taken for it, untried
    assert rig.node.values[CONSUMER] == 0
    rig.enable()
    for _ in range(50):
        rig.cycle(0.02)
    assert rig.cycle(0.0).condition is Condition.OK
    for late_ms in range(1, 200):
        rig.node.tick(rig.now_s + 1e-3 * late_ms)
    assert rig.node.state is DriveState.FAULT
    assert abs(rig.plant.velocity_rad_s) < 0.5


# -- reactions --------------------------------------------------------------------------------------------------------


def test_reactions_are_ramps_and_a_fault(rig: Rig, device: DeviceSetup) -> None:
    write_reactions(device)
    assert [rig.node.values[key] for key in (0x605A_00, 0x605E_00, 0x6007_00, 0x1029_01)] == [2, 2, 1, 1]


@pytest.mark.parametrize(("key", "held", "message"), [
    (0x605A_00, 0, r"0x605A: the drive would not brake at a quick stop; given: 0, and it refuses.*; allowed: 1 to 8"),
    (0x605A_00, 1, None), (0x605A_00, 6, None),
    (0x6007_00, 0, r"0x6007: the drive does nothing when its master is lost; given: 0, .*; allowed: 1 to 3"),
    (0x6007_00, 3, None), (0x6007_00, -1, None), (0x605E_00, 0, None), (0x1029_01, 0, None),
])  # fmt: skip
def test_a_drive_may_keep_what_still_stops_the_axis(
    rig: Rig, device: DeviceSetup, key: int, held: int, message: str | None
) -> None:
    keep(rig, key, held)
    if message is None:
        write_reactions(device)
        assert len(device.kept) == 1
        return
    with pytest.raises(ConfigurationError, match=message):
        write_reactions(device)


# -- cycle times ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sync", [0x4000_0080, 0x0000_0081, 0x4000_0000 | 0x081])
def test_sync_is_made_that_of_the_master(rig: Rig, device: DeviceSetup, sync: int) -> None:
    rig.node.values[0x1005_00] = sync
    write_timing(device, 0.002, CST)
    assert rig.node.values[0x1005_00] == 0x80
    assert rig.node.values[0x1006_00] == 2000


def test_a_sync_that_is_right_is_not_written(rig: Rig, device: DeviceSetup) -> None:
    written: list[int] = []
    rig.node.dictionary.on_write(0x1005, lambda index, subindex, wanted: written.append(wanted))
    rig.node.values[0x1005_00] = 0x8000_0080  # bit 31 has no meaning
    write_timing(device, 0.001, CST)
    assert written == device.kept == []


@pytest.mark.parametrize(
    ("units", "exponent", "held"), [(1, -3, None), (10, -4, None), (2, -3, "0.002"), (1, -2, "0.01")]
)
def test_an_interpolation_time_that_the_drive_keeps(
    rig: Rig, device: DeviceSetup, units: int, exponent: int, held: str | None
) -> None:
    def refuse(index: int, subindex: int, wanted: int) -> None:
        raise SdoAbort(AbortCode.READ_ONLY)

    rig.node.values[0x60C2_01], rig.node.values[0x60C2_02] = units, exponent
    rig.node.dictionary.on_write(0x60C2, refuse)
    write_timing(device, 0.001, CST)
    assert device.kept == ([f"0x60C2 (interpolation time) {held} s instead of 0.001 s"] if held else [])
    if held:
        with pytest.raises(ConfigurationError, match="0x60C2"):
            write_timing(device, 0.001, CSP)
    else:
        write_timing(device, 0.001, CSP)


@pytest.mark.parametrize("hidden", [1, 2])
def test_an_interpolation_time_of_which_a_part_cannot_be_read_is_named(
    rig: Rig, device: DeviceSetup, hidden: int
) -> None:
    def read(index: int, subindex: int) -> bytes:
        if (index, subindex) == (0x60C2, hidden):
            raise SdoAbort(AbortCode.WRITE_ONLY)
        return rig.node.dictionary.read(index, subindex)

    def write(index: int, subindex: int, data: bytes) -> None:
        if index == 0x60C2:
            raise SdoAbort(AbortCode.READ_ONLY)
        rig.node.dictionary.write(index, subindex, data)

    rig.node._sdo = SdoServer(read, write)
    write_timing(device, 0.001, CST)
    assert [text.split(" (")[0] for text in device.kept] == ["0x60C2"]
    with pytest.raises(ConfigurationError, match="0x60C2"):
        write_timing(device, 0.001, CSP)


# -- reset of a fault -------------------------------------------------------------------------------------------------


def test_a_fault_is_reset_by_one_edge_after_its_reaction(rig: Rig, device: DeviceSetup) -> None:
    written: list[int] = []
    taken = rig.node._on_controlword_sdo

    def seen(index: int, subindex: int, value: int) -> None:
        written.append(value)
        taken(index, subindex, value)

    rig.node.dictionary.on_write(0x6040, seen)
    rig.node._set_state(DriveState.FAULT_REACTION_ACTIVE)
    reads = [0]
    answer = rig.node._sdo.answer

    def slow(request: bytes) -> bytes | None:
        reads[0] += request[1:3] == b"\x41\x60"
        if reads[0] == 50 and rig.node.state is DriveState.FAULT_REACTION_ACTIVE:
            rig.node._set_state(DriveState.FAULT)
        return answer(request)

    rig.node._sdo.answer = slow
    assert reset_fault(device) == rig.node.values[0x6041_00]
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED
    assert written == [0, 0x80, 0]


def test_a_reaction_without_end_is_waited_for_a_second(rig: Rig, device: DeviceSetup) -> None:
    rig.node._set_state(DriveState.FAULT_REACTION_ACTIVE)
    begin_s = rig.master.network.time_s
    reset_fault(device)
    assert 4.0 <= rig.master.network.time_s - begin_s < 4.2  # and three for the reset
    assert rig.node.state is DriveState.FAULT_REACTION_ACTIVE
