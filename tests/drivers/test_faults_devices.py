"""Faults that drive and encoder report or that change their state: EMCY, reboot, power off, alarm."""

from __future__ import annotations

import pytest
from drive_rig import Rig, running

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState, OperationMode
from drivers.emcy import decode_emergency
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition, DriveFault, DriveGoal, EncoderError

ENCODER_TPDO = 0x186


def test_emcy_stops_the_axis_and_is_forgotten_after_a_reset() -> None:
    _, rig = running()
    rig.node.emergency(0x4310, 0x09, rig.now_s, b"\x01\x02")
    sample = rig.cycle(1.0)
    assert sample.condition & Condition.EMERGENCY
    assert rig.drive.goal is DriveGoal.QUICK_STOP
    with pytest.raises(DriveFault, match=r"EMCY 0x4310 excess drive temperature, error register: generic, temperature, "
                       r"detail 01 02 00 00 00"):  # fmt: skip
        rig.drive.check()
    rig.drive.reset_fault()
    rig.drive.check()


def test_a_rebooted_drive_is_not_operational_any_more() -> None:
    _, rig = running()
    rig.node.reset(rig.now_s)
    sample = rig.cycle(1.0)
    assert sample.condition & Condition.NOT_OPERATIONAL
    assert rig.drive.goal is DriveGoal.QUICK_STOP


def test_a_drive_that_switches_off_by_itself_is_not_switched_on_again() -> None:
    _, rig = running()
    rig.node.values[0x6007_00] = 2  # abort connection option: power off without a fault
    rig.node.communication_lost(rig.now_s)
    sample = rig.cycle()
    assert sample.condition is Condition.DISABLED
    for _ in range(20):
        assert not rig.cycle().enabled


def test_encoder_loss_and_alarm_are_seen_in_its_samples_only() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, ENCODER_TPDO, count=5))
    seen = []
    for _ in range(6):
        rig.cycle()
        seen.append(rig.encoder_sample.condition)
    stale = Condition.LATE | Condition.STALE
    assert seen == [Condition.LATE] * 3 + [stale] * 2 + [Condition.OK]
    rig.encoder_node.raise_alarm(rig.now_s)
    assert rig.cycle().condition is Condition.OK
    assert rig.encoder_sample.condition is Condition.ALARM
    with pytest.raises(EncoderError, match=r"encoder node 6: ALARM; given: EMCY 0x7310"):
        rig.encoder.check()
    rig.encoder_node.clear_alarm(rig.now_s)
    rig.cycle()
    rig.encoder.check()


def test_quick_stop_without_loops_in_the_drive_switches_off() -> None:
    bus = ModelledBus(1_000_000)
    rig = Rig(bus.port(), bus.port(), reply_s=0.0006, settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_TORQUE))
    rig.set_up()
    rig.enable()
    rig.drive.goal = DriveGoal.QUICK_STOP
    for _ in range(4):
        sample = rig.cycle(1.0)
    assert sample.state is DriveState.SWITCH_ON_DISABLED
    assert sample.torque_n_m == 0.0


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "EMCY 0x0000 error reset, no error"),
        (b"\x30", "EMCY 0x0030 error reset, no error"),
        (b"\x30\x81", "EMCY 0x8130 life guard or heartbeat error"),
        (b"\x11\x23\x02", "EMCY 0x2311 current, output side, error register: current"),
        (b"\x00\x5f\x01", "EMCY 0x5F00 device hardware, error register: generic"),
        (b"\x00\xb0\x00\x00\x00\x00\x00\x07", "EMCY 0xB000 unknown class, detail 00 00 00 00 07"),
    ],
)
def test_emcy_text_also_of_short_frames(data: bytes, text: str) -> None:
    assert decode_emergency(data, 0.0).text == text
