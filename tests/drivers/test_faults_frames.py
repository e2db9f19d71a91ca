"""Frames that are lost, late, cut or corrupt at a known place in virtual time, and the state of the bus."""

from __future__ import annotations

import pytest
from drive_rig import in_process, running

from drivers.bus import BusState
from drivers.cia402 import DriveState
from drivers.modelled_bus import Fault, FaultKind
from drivers.port import Condition, DriveFault, DriveGoal

TPDO, RPDO, SYNC = 0x185, 0x205, 0x080


def test_one_lost_answer_is_late_and_no_reason_to_stop() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, TPDO))
    late = rig.cycle()
    assert late.condition is Condition.LATE
    assert late.age_cycles == 1
    after = rig.cycle()
    assert after.condition is Condition.OK
    assert after.enabled
    assert rig.drive.tripped is Condition.OK


@pytest.mark.parametrize("can_id", [TPDO, SYNC])
def test_answers_lost_too_often_stop_the_axis(can_id: int) -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, can_id, count=4))
    conditions = [rig.cycle().condition for _ in range(4)]
    assert conditions[:3] == [Condition.LATE] * 3
    assert conditions[3] == Condition.LATE | Condition.STALE
    assert rig.drive.goal is DriveGoal.QUICK_STOP
    for _ in range(300):
        sample = rig.cycle(2.0)
    assert sample.state is DriveState.SWITCH_ON_DISABLED
    assert abs(rig.plant.velocity_rad_s) < 0.5
    with pytest.raises(DriveFault, match=r"drive node 5: tripped: STALE"):
        rig.drive.check()


def test_lost_commands_leave_the_last_torque_and_are_not_fatal() -> None:
    bus, rig = running()
    rig.cycle(1.5)
    bus.inject(Fault(FaultKind.DROP, RPDO, count=3))
    torques = [rig.cycle(-1.0).torque_n_m for _ in range(5)]
    assert torques == [1.5, 1.5, 1.5, 1.5, -1.0]


def test_corrupt_statusword_trips_and_truncated_frame_counts_as_lost() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.TRUNCATE, TPDO))
    assert rig.cycle().condition is Condition.LATE
    assert rig.drive.malformed_frames == 1
    bus.inject(Fault(FaultKind.CORRUPT, TPDO))
    assert rig.cycle().condition is Condition.DISABLED  # 0xC8: not the code of any state
    assert rig.drive.goal is DriveGoal.QUICK_STOP


def test_short_rpdo_is_answered_by_emcy_8210_and_not_obeyed() -> None:
    bus, rig = running()
    rig.cycle(1.0)
    bus.inject(Fault(FaultKind.TRUNCATE, RPDO))
    rig.cycle(-3.0)
    sample = rig.cycle(0.0)
    assert sample.torque_n_m == 1.0
    assert rig.drive.emergencies[-1].text.startswith("EMCY 0x8210 PDO not processed due to length error")
    assert sample.condition & Condition.EMERGENCY


def test_emergencies_without_end_do_not_fill_the_memory_and_the_last_one_is_kept() -> None:
    rig = in_process()
    rig.set_up()
    for code in range(0xFF00, 0xFF00 + 250):
        rig.node.emergency(code, 0x81, rig.now_s)
    assert 10 <= len(rig.drive.emergencies) < 200
    assert rig.drive.emergencies[-1].code == 0xFFF9


def test_late_answer_is_used_by_the_next_cycle() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DELAY, TPDO, delay_s=0.0007))
    assert rig.cycle().age_cycles == 1
    assert rig.cycle().age_cycles == 0


def test_bus_off_of_the_master_is_visible_and_the_drive_stops_by_itself() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.BUS_OFF, SYNC))
    sample = rig.cycle(1.0)
    assert sample.condition & Condition.BUS_OFF
    assert rig.drive.goal is DriveGoal.QUICK_STOP
    assert rig.master.health.state is BusState.OFF
    for _ in range(100):  # nothing reaches the drive but its own clock
        rig.cycle(1.0)
        rig.node.tick(rig.now_s)
    assert rig.master.health.frames_lost > 100
    assert rig.node.state is DriveState.FAULT  # after its stop ramp
    assert abs(rig.plant.velocity_rad_s) < 0.5
    with pytest.raises(DriveFault, match="BUS_OFF"):
        rig.drive.check()


def test_errors_on_the_bus_first_warn_then_put_it_off() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.ERROR_FRAME, RPDO, count=200))
    conditions = [rig.cycle().condition for _ in range(200)]
    passive = next(k for k, condition in enumerate(conditions) if condition & Condition.BUS_PASSIVE)
    off = next(k for k, condition in enumerate(conditions) if condition & Condition.BUS_OFF)
    assert passive < off
    assert conditions[passive] is Condition.BUS_PASSIVE  # a warning: still enabled


def test_bus_load_of_a_kilohertz_loop() -> None:
    bus, rig = running()
    bus.load()
    for _ in range(1000):
        rig.cycle()
    # SYNC 55, RPDO 4 bytes 95, TPDOs 8 and 2 bytes 135 and 75, encoder 4 bytes 95 bits at 1 kHz; 3 heartbeats
    assert bus.load() == pytest.approx(0.455 + 3 * 50 * 65e-6, abs=0.01)
