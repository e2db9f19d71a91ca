"""How long a stop may go without effect, the question whether power is off, what the drive reports of itself."""

from __future__ import annotations

import pytest
from drive_rig import Rig, in_process, running, servo

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState, HomingPhase, OperationMode
from drivers.homing import HomingRun
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
    for _ in range(50):
        rig.cycle(sign * 2.0)
    for _ in range(2):
        rig.cycle(0.0)
    speed_rad_s = abs(rig.plant.velocity_rad_s)
    rig.node._loops.stop_target = lambda *_: ServoTarget(sign * speed_rad_s)  # it says that it stops, and goes on
    rig.drive.goal = DriveGoal.QUICK_STOP
    assert cycles_until_cut(rig) == pytest.approx(1000 * (1.5 * speed_rad_s / 100.0 + 0.1), abs=2)


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
