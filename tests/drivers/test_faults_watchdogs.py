"""Watchdogs of both sides: heartbeats, deadline of the set-points, a stop that does not end."""

from __future__ import annotations

import pytest
from drive_rig import Rig, in_process, running, servo

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from drivers.port import Condition, DriveFault, DriveGoal, EncoderError, ServoTarget

RPDO, HEARTBEAT, SYNC = 0x205, 0x705, 0x080


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
    """The RPDO is missed after its 50 ms, and the ramp from 10 rad/s takes 10 ms more."""
    _, rig = running()
    states = []
    for late_ms in range(1, 101):
        rig.node.tick(rig.now_s + 1e-3 * late_ms)
        states.append(rig.node.state)
    assert states[35] is DriveState.OPERATION_ENABLED  # the last heartbeat is at most 20 ms old
    order = [s for k, s in enumerate(states) if k == 0 or s is not states[k - 1]]
    assert order == [DriveState.OPERATION_ENABLED, DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT]
    assert states.index(DriveState.FAULT_REACTION_ACTIVE) < 60


def test_the_drive_s_watchdogs_run_out_during_a_stall_and_not_after_it() -> None:
    """A second that passes in one step, as for a loop that stalls, moves the axis as one in steps of a period."""
    travelled_rad = []
    for steps in (1, 1000):
        _, rig = running()
        rig.cycle(0.5)
        before_rad = rig.plant.motor_position_rad
        for k in range(1, steps + 1):
            rig.node.tick(rig.now_s + k / steps)
        assert rig.node.state is DriveState.FAULT
        assert abs(rig.plant.velocity_rad_s) < 0.5
        travelled_rad.append(rig.plant.motor_position_rad - before_rad)
    assert travelled_rad[0] == pytest.approx(travelled_rad[1], rel=0.03)  # a period of about 60 until rest


def test_an_answer_is_as_old_as_syncs_were_sent_after_its_own() -> None:
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, 0x185, count=3))
    assert [rig.cycle(0.0).age_cycles for _ in range(4)] == [1, 2, 3, 0]


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
