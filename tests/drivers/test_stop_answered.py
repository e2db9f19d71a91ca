"""How long a stop may go without effect, the question whether power is off, what the drive reports of itself."""

from __future__ import annotations

import pytest
from drive_rig import Rig, in_process, running, servo

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState, HomingPhase, OperationMode
from drivers.homing import HomingRun
from drivers.modelled_bus import Fault, FaultKind
from drivers.port import Condition, DriveFault, DriveGoal, ServoTarget


def deaf(rig: Rig) -> None:
    """Let the drive take no controlword any more, and no stop of its own."""
    rig.node._take_controlword = lambda now_s: None
    rig.node.communication_lost = lambda now_s: None


def cycles_until_cut(rig: Rig) -> int:
    return next(k for k in range(1000) if rig.cycle() and rig.master.silent)


@pytest.mark.parametrize("goal", [DriveGoal.QUICK_STOP, DriveGoal.DISABLED])
@pytest.mark.parametrize(
    ("settings", "cycles"),
    [
        (DriveSettings(), 10),  # 10 ms for a transition of the drive
        (DriveSettings(missed_answers_allowed=15), 18),  # three more than may be missed
        (DriveSettings(period_s=0.004), 6),
        (DriveSettings(period_s=0.0025, missed_answers_allowed=0), 4),
    ],
)
def test_a_drive_that_stays_enabled_is_cut_off_after_the_cycles_of_an_answer(
    goal: DriveGoal, settings: DriveSettings, cycles: int
) -> None:
    rig = in_process(settings=settings)
    rig.set_up()
    rig.enable()
    deaf(rig)
    rig.drive.goal = goal
    assert cycles_until_cut(rig) == cycles
    assert rig.drive.read(rig.now_s).condition & Condition.UNANSWERED


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_quick_stop_may_take_one_and_a_half_times_its_ramp_and_a_tenth_of_a_second(sign: float) -> None:
    rig = in_process(servo=servo(), settings=DriveSettings(quick_stop_rad_s2=100.0))
    rig.set_up()
    rig.enable()
    for _ in range(48):
        rig.cycle(sign * 2.0)  # 9.6 rad/s
    for _ in range(2):
        rig.cycle(0.0)
    speed_rad_s = abs(rig.plant.velocity_rad_s)
    rig.node._loops.stop_target = lambda *_: ServoTarget(sign * speed_rad_s)  # it says that it stops, and goes on
    rig.drive.goal = DriveGoal.QUICK_STOP
    assert cycles_until_cut(rig) == pytest.approx(1000 * (1.5 * speed_rad_s / 100.0 + 0.1), abs=2)


def test_a_long_ramp_is_not_cut_off() -> None:
    """The time allowed follows from the speed at its begin, not from that which is left."""
    rig = in_process(servo=servo(), settings=DriveSettings(quick_stop_rad_s2=20.0))
    rig.set_up()
    rig.enable()
    for _ in range(50):
        rig.cycle(2.0)
    speed_rad_s = rig.plant.velocity_rad_s
    rig.drive.goal = DriveGoal.QUICK_STOP
    cycles = next(k for k in range(2000) if rig.cycle().state is DriveState.SWITCH_ON_DISABLED)
    assert cycles > 0.9 * 1000 * speed_rad_s / 20.0 > 400
    assert not rig.master.silent
    assert rig.drive.tripped is Condition.OK


def test_a_stop_is_timed_from_its_own_command() -> None:
    """Not from an earlier one that the drive obeyed."""
    rig = in_process()
    rig.set_up()
    for _ in range(3):
        rig.enable()
        rig.drive.goal = DriveGoal.DISABLED
        for _ in range(8):
            rig.cycle()
        assert not rig.master.silent
    rig.enable()
    deaf(rig)
    rig.drive.goal = DriveGoal.DISABLED
    assert cycles_until_cut(rig) == 10


def test_a_drive_that_enables_by_itself_is_cut_off_as_one_that_stays_enabled() -> None:
    rig = in_process()
    rig.set_up()
    for _ in range(5):
        rig.cycle()
    deaf(rig)
    rig.node._set_state(DriveState.OPERATION_ENABLED)
    assert cycles_until_cut(rig) == 10


def test_after_the_cut_no_set_point_is_sent() -> None:
    rig = in_process()
    rig.set_up()
    rig.enable()
    deaf(rig)
    rig.drive.goal = DriveGoal.QUICK_STOP
    cycles_until_cut(rig)
    sent: list[int] = []
    rig.node_port.listen(0x205, lambda can_id, data, now_s: sent.append(can_id))
    for _ in range(5):
        rig.cycle(1.0)
    assert sent == []


def test_power_off_is_confirmed_by_sdo_only_if_the_drive_says_so() -> None:
    rig = in_process()
    rig.set_up()
    rig.enable()
    assert rig.drive.confirm_off(rig.now_s)
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED
    assert rig.drive.status.startswith("SWITCH_ON_DISABLED, statusword 0x")
    rig = in_process()
    rig.set_up()
    rig.enable()
    deaf(rig)
    assert not rig.drive.confirm_off(rig.now_s)
    assert rig.drive.status == f"OPERATION_ENABLED, statusword 0x{rig.node.values[0x6041_00]:04X}"


@pytest.mark.parametrize("watch", [True, False])
def test_what_a_reset_cleared_is_not_told_with_a_later_fault(watch: bool) -> None:
    bus, rig = running(settings=DriveSettings(watch_setpoint=watch))
    if watch:
        bus.inject(Fault(FaultKind.DROP, 0x205, count=10))
        for k in range(10):
            rig.cycle(0.2 * k)
        with pytest.raises(DriveFault, match="acts, commanded were"):
            rig.drive.check()
    rig.drive.reset_fault()
    rig.drive.check()
    rig.node.emergency(0x4310, 0x09, rig.now_s)
    rig.cycle()
    with pytest.raises(DriveFault, match="0x4310") as caught:
        rig.drive.check()
    assert "acts, commanded were" not in str(caught.value)


def test_a_drive_is_enabled_again_right_after_a_reset() -> None:
    """That it was enabled before is no sign that it switched off by itself."""
    _, rig = running()
    rig.node.emergency(0x4310, 0x09, rig.now_s)
    for _ in range(400):
        rig.cycle()
    rig.drive.reset_fault()
    rig.drive.goal = DriveGoal.ENABLED
    assert rig.drive.read(rig.now_s).condition is Condition.OK
    assert rig.enable().enabled


@pytest.mark.parametrize("length", [0, 1, 3])
def test_a_demand_of_any_other_length_is_malformed(length: int) -> None:
    _, rig = running()
    rig.node.port.send(0x285, bytes(length), rig.now_s)
    assert rig.cycle().condition is Condition.OK
    assert rig.drive.malformed_frames == 1


def in_lasting_fault() -> Rig:
    """A drive with a fault whose cause lasts, asked once to reset it."""
    rig = in_process()
    rig.set_up()
    rig.enable()
    rig.node.trip(0x4310, 0x08, rig.now_s, lasting=True)
    rig.cycle()
    rig.drive.reset_fault()
    return rig


def reset_bits(rig: Rig, cycles: int) -> list[bool]:
    """Return which of the next controlwords have the bit of a fault reset."""
    sent: list[bool] = []
    rig.node_port.listen(0x205, lambda can_id, data, now_s: sent.append(bool(data[0] & 0x80)))
    for _ in range(cycles):
        rig.cycle()
    return sent


def test_a_request_to_reset_a_fault_is_used_up_by_one_edge() -> None:
    """A cause that goes away later does not end the fault without another request."""
    rig = in_lasting_fault()
    assert reset_bits(rig, 10) == [True] + [False] * 9
    rig.node.clear_cause()
    assert not any(reset_bits(rig, 10))
    assert rig.node.state is DriveState.FAULT


def test_a_second_request_waits_until_its_edge_can_rise() -> None:
    rig = in_lasting_fault()
    assert reset_bits(rig, 1) == [True]
    rig.drive.reset_fault()
    assert reset_bits(rig, 4) == [False, True, False, False]


def test_a_reset_asked_for_during_the_fault_reaction_waits_for_its_end() -> None:
    """The ramp of the reaction takes no command; the edge comes when the drive is in FAULT."""
    _, rig = running()
    rig.node.trip(0x4310, 0x08, rig.now_s)
    while rig.cycle().state is not DriveState.FAULT_REACTION_ACTIVE:
        pass
    rig.drive.reset_fault()
    states, sent = [], reset_bits(rig, 0)
    while rig.node.state in (DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT) and len(states) < 500:
        states.append(rig.node.state)
        rig.cycle()
    assert states.count(DriveState.FAULT_REACTION_ACTIVE) > 3
    assert sum(sent) == 1
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED


def test_what_tripped_the_drive_first_is_kept_when_it_has_passed() -> None:
    """Answers that come again do not take back that they were missed."""
    bus, rig = running()
    bus.inject(Fault(FaultKind.DROP, 0x185, count=6))
    for _ in range(10):
        rig.cycle()
    assert rig.drive.read(rig.now_s).condition & Condition.STALE == 0
    rig.node.emergency(0x4310, 0x09, rig.now_s)
    rig.cycle()
    assert rig.drive.tripped & Condition.STALE
    assert rig.drive.tripped & Condition.EMERGENCY


def test_the_last_emergency_is_the_error_code() -> None:
    _, rig = running()
    assert rig.drive.error_code == 0
    for code in (0x4310, 0x2310, 0x3210):
        rig.node.emergency(code, 0x01, rig.now_s)
    rig.cycle()
    assert rig.drive.error_code == 0x3210
    with pytest.raises(DriveFault, match="0x3210"):
        rig.drive.check()


def test_what_tripped_the_drive_first_is_kept_beside_what_follows() -> None:
    _, rig = running()
    rig.node.emergency(0x4310, 0x09, rig.now_s)
    rig.cycle()
    rig.node.reset(rig.now_s)
    rig.cycle()
    assert rig.drive.tripped & Condition.EMERGENCY
    assert rig.drive.tripped & Condition.NOT_OPERATIONAL
    assert not rig.drive.tripped & Condition.LATE


def test_a_set_up_begins_anew_after_a_trip() -> None:
    _, rig = running()
    rig.node.emergency(0x4310, 0x09, rig.now_s)
    rig.cycle()
    rig.drive.set_up()
    rig.master.start(rig.now_s)
    assert (rig.drive.tripped, rig.drive.goal) == (Condition.OK, DriveGoal.DISABLED)
    assert rig.cycle().condition is Condition.OK
    assert rig.enable().enabled


def test_a_set_point_is_sent_in_the_unit_of_its_object() -> None:
    for mode, index, unit in ((OperationMode.CYCLIC_SYNC_TORQUE, 0x6071_00, 0.004),
                              (OperationMode.CYCLIC_SYNC_VELOCITY, 0x60FF_00, None)):  # fmt: skip
        rig = in_process(settings=DriveSettings(mode=mode), servo=servo())
        rig.set_up()
        rig.enable()
        rig.cycle(0.5)
        assert rig.node.values[index] == round(0.5 / (unit or rig.drive.info.rad_per_count))


@pytest.mark.parametrize(("target", "counts"), [
    (2**31 - 1, 2**31 - 1), (2**31, -(2**31)), (2**31 + 5, -(2**31) + 5), (-(2**31), -(2**31)),
    (-(2**31) - 1, 2**31 - 1)])  # fmt: skip
def test_a_position_beyond_the_range_of_its_object_wraps(target: int, counts: int) -> None:
    rig = in_process(settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_POSITION), servo=servo())
    rig.set_up()
    rig.enable()
    rig.cycle(target * rig.drive.info.rad_per_count)
    assert rig.node.values[0x607A_00] == counts


@pytest.mark.parametrize("start_s", [0.0, 5.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_homing_is_done_when_the_measured_speed_is_that_of_standstill(sign: float, start_s: float) -> None:
    """Two samples 2 ms apart: the speed is their difference over 2 ms, in rad/s."""
    rig = in_process(settings=DriveSettings(mode=OperationMode.HOMING), servo=servo())
    rig.set_up()
    enabled = rig.enable()
    run = HomingRun(rig.drive, standstill_rad_s=0.05)
    time_s, position_rad = start_s, 0.0

    def step(speed_rad_s: float, bits: int) -> HomingPhase:
        nonlocal time_s, position_rad
        time_s, position_rad = time_s + 0.002, position_rad + 0.002 * sign * speed_rad_s
        word = enabled.statusword & ~0x3400 | bits
        return run.step(enabled._replace(time_s=time_s, motor_position_rad=position_rad, statusword=word))

    for _ in range(3):
        step(1.0, 0)
    assert run.phase is HomingPhase.RUNNING
    assert rig.drive.controlword_bits == 0x10
    assert step(0.06, 0x1400) is HomingPhase.RUNNING  # attained and reached, but faster
    before = enabled._replace(
        time_s=time_s - 0.01, motor_position_rad=position_rad, statusword=enabled.statusword | 0x1400
    )
    assert run.step(before) is HomingPhase.RUNNING  # time that does not go on tells no speed
    time_s -= 0.01
    assert step(0.04, 0x1400) is HomingPhase.DONE
    assert rig.drive.controlword_bits == 0


def test_homing_goes_on_over_a_sample_that_is_late() -> None:
    """The same sample twice tells no speed, neither at rest nor in motion."""
    rig = in_process(settings=DriveSettings(mode=OperationMode.HOMING), servo=servo())
    rig.set_up()
    sample = rig.enable()
    run = HomingRun(rig.drive, standstill_rad_s=0.05)
    assert [run.step(sample) for _ in range(2)] == [HomingPhase.READY] * 2
    after = sample._replace(time_s=sample.time_s + 0.001)
    assert run.step(after) is not HomingPhase.READY
    assert run.step(after) is run.phase
