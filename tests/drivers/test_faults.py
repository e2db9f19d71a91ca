"""Every fault of the bus and of the drive, injected at a known frame in virtual time, leads to the defined state."""

from __future__ import annotations

import math
from typing import Any

import pytest
from drive_rig import Rig, in_process

from drivers.bus import BusState
from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState, OperationMode
from drivers.emcy import decode_emergency
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition, DriveFault, DriveGoal, EncoderError, ServoTarget
from drivers.sim.servo import DriveServo, Servo

TPDO, RPDO, ENCODER_TPDO, HEARTBEAT, SYNC = 0x185, 0x205, 0x186, 0x705, 0x080


def servo() -> DriveServo:
    return DriveServo(
        Servo(velocity_gain_n_m_s_rad=1.0, velocity_integral_time_s=0.02, position_every=1), 0.01 / (2 * math.pi)
    )


def running(**options: Any) -> tuple[ModelledBus, Rig]:
    """Enabled and turning at about 10 rad/s."""
    bus = ModelledBus(1_000_000)
    rig = Rig(bus.port(), bus.port(), reply_s=0.0006, servo=servo(), **options)
    rig.set_up()
    rig.enable()
    for _ in range(50):
        rig.cycle(2.0)
    assert rig.cycle(0.0).condition is Condition.OK
    return bus, rig


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


def test_late_answer_is_used_by_the_next_cycle() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DELAY, TPDO, delay_s=0.0007))
    assert rig.cycle().age_cycles == 1
    assert rig.cycle().age_cycles == 0


def test_a_silent_master_is_noticed_by_the_drive_which_brakes_and_faults() -> None:
    bus, rig = running()
    speed = rig.plant.velocity_rad_s
    assert speed > 5
    bus.inject(Fault(FaultKind.DROP, 0x701, count=10_000))  # the master's heartbeat, SYNC and set-points go on
    states = [rig.cycle(0.0).state for _ in range(400)]
    order = [s for k, s in enumerate(states) if k == 0 or s is not states[k - 1]]
    assert order == [DriveState.OPERATION_ENABLED, DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT]
    lost_after = states.index(DriveState.FAULT_REACTION_ACTIVE)
    assert 40 <= lost_after <= 81  # three heartbeats of 20 ms, and up to one more
    assert abs(rig.plant.velocity_rad_s) < 0.5
    assert rig.drive.emergencies[-1].code == 0x8130
    assert "life guard or heartbeat error" in rig.drive.emergencies[-1].text
    with pytest.raises(DriveFault, match=r"EMERGENCY \| FAULT.*EMCY 0x8130"):
        rig.drive.check()


def test_a_dead_master_is_noticed_without_any_frame() -> None:
    _, rig = running()
    rig.node.tick(rig.now_s + 0.035)  # the last heartbeat is at most 20 ms old
    assert rig.node.state is DriveState.OPERATION_ENABLED
    rig.node.tick(rig.now_s + 0.070)
    assert rig.node.state is DriveState.FAULT_REACTION_ACTIVE


@pytest.mark.parametrize("node_id", [5, 6])
def test_a_heartbeat_that_is_never_heard_is_missed_as_one_that_is_lost(node_id: int) -> None:
    """Drive (5) and encoder (6) were told to send it (0x1017): 60 ms after the first answer to a SYNC without it."""
    bus = ModelledBus(1_000_000)
    bus.inject(Fault(FaultKind.DROP, 0x700 + node_id, count=10_000))
    rig = Rig(bus.port(), bus.port(), reply_s=0.0006, servo=servo())
    rig.set_up()
    rig.enable()
    found = []
    for _ in range(100):
        sample = rig.cycle(0.0)
        condition = sample.condition if node_id == 5 else rig.encoder_sample.condition
        if condition & Condition.HEARTBEAT_LOST:
            found.append(rig.tick)
    assert 60 <= found[0] <= 62
    if node_id == 5:
        assert rig.drive.goal is DriveGoal.QUICK_STOP
        with pytest.raises(DriveFault, match="HEARTBEAT_LOST"):
            rig.drive.check()
    else:
        with pytest.raises(EncoderError, match="HEARTBEAT_LOST"):
            rig.encoder.check()


def test_a_lost_heartbeat_of_the_drive_stops_the_axis() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, HEARTBEAT, count=10_000))
    conditions = [rig.cycle().condition for _ in range(90)]
    first = next(k for k, condition in enumerate(conditions) if condition)
    assert conditions[first] is Condition.HEARTBEAT_LOST
    assert 40 <= first <= 81
    assert rig.drive.goal is DriveGoal.QUICK_STOP


def test_a_mute_drive_is_stale_then_lost() -> None:
    _, rig = running()
    rig.node.mute = True
    seen = Condition.OK
    for _ in range(90):
        seen |= rig.cycle().condition
    assert seen == Condition.LATE | Condition.STALE | Condition.HEARTBEAT_LOST | Condition.UNANSWERED
    assert rig.node.state is DriveState.FAULT
    assert abs(rig.plant.velocity_rad_s) < 0.5


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


def test_bus_load_of_a_kilohertz_loop() -> None:
    bus, rig = running()
    bus.load()
    for _ in range(1000):
        rig.cycle()
    # SYNC 55, RPDO 4 bytes 95, TPDO 8 bytes 135, encoder 4 bytes 95 bits at 1 kHz; heartbeats of 3 nodes
    assert bus.load() == pytest.approx(0.380 + 3 * 50 * 65e-6, abs=0.01)


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


def test_a_quick_stop_that_does_not_end_is_cut_off_after_its_ramp() -> None:
    _, rig = running()
    speed_rad_s = rig.plant.velocity_rad_s
    rig.node._loops.stop_target = lambda *_: ServoTarget(speed_rad_s)  # it says that it stops, and goes on
    rig.drive.goal = DriveGoal.QUICK_STOP
    cut = next(k for k in range(400) if rig.cycle() and rig.master.silent)
    ramp_cycles = 1000 * speed_rad_s / rig.drive.info.quick_stop_rad_s2
    assert ramp_cycles + 50 < cut < 1.5 * ramp_cycles + 110
    assert rig.cycle().condition & Condition.UNANSWERED
    assert rig.drive.tripped & Condition.UNANSWERED
    with pytest.raises(DriveFault, match="UNANSWERED"):
        rig.drive.check()


def test_an_rpdo_deadline_is_never_shorter_than_the_loop_needs() -> None:
    slow = in_process(settings=DriveSettings(period_s=0.025))
    slow.set_up()
    assert slow.node.values[0x1400_05] == 75
