"""A stop of the drive judged by its answers: under way, too long, an acceleration; and what the driver does then."""

from __future__ import annotations

import math
from collections.abc import Iterable

import pytest
from drive_rig import Rig, in_process, servo

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState
from drivers.port import Condition, DriveGoal
from drivers.stop_watch import StopAnswer, StopVerdict, StopWatch

RAMP, COUNT = 100.0, 0.01  # rad/s^2, rad/s
MARGIN = 0.02 * RAMP + 4 * COUNT
GOES_ON, ACCELERATES, LATE = StopVerdict.GOES_ON, StopVerdict.ACCELERATES, StopVerdict.LATE


def verdicts(speeds: Iterable[float], top: float = 10.0, ramp: float = RAMP, fresh: bool = True) -> list[StopVerdict]:
    """Verdicts on a stop from the speed `top`, after the answer that reports its begin."""
    watch = StopWatch(0.001, 3)
    for enabled in (True, False):
        watch.step(StopAnswer(top, COUNT, enabled=enabled, fresh=True), ramp)
    return [watch.step(StopAnswer(speed, COUNT, enabled=False, fresh=fresh), ramp) for speed in speeds]


def test_a_speed_that_rises_beyond_the_begin_of_the_stop_is_an_acceleration() -> None:
    assert verdicts([10.0 + k for k in range(9)]) == [GOES_ON] * 8 + [ACCELERATES]
    assert ACCELERATES not in verdicts([10.0 + 0.2 * k for k in range(9)])  # 11.6: within the margin


@pytest.mark.parametrize(("share", "found"), [(0.99, GOES_ON), (1.01, ACCELERATES)])
def test_the_margin_beyond_the_begin_of_the_stop(share: float, found: StopVerdict) -> None:
    assert verdicts([10.0] * 8 + [10.0 + share * MARGIN])[-1] is found
    watch = StopWatch(0.001, 3)
    for speed in [10.0] * 10 + [10.0 + share * (5.0 + 4 * COUNT)]:
        last = watch.step(StopAnswer(speed, COUNT, enabled=False, fresh=True), RAMP, 5.0)
    assert last is found


def test_a_loop_that_takes_over_a_weight_slows_the_rise() -> None:
    """Its speed rises ever less, one around a wrong sign does not: an exponential to a level, and one away from it."""
    sound = [10.0 + 8.0 * (1.0 - math.exp(-k / 12.0)) for k in range(60)]
    assert ACCELERATES not in verdicts(sound)
    assert ACCELERATES in verdicts([10.0 + 0.5 * math.exp(k / 12.0) for k in range(60)])
    assert ACCELERATES in verdicts([10.0 + 0.5 * k for k in range(60)])  # at the torque limit


@pytest.mark.parametrize(("share", "accelerates"), [(0.88, False), (0.92, True)])
def test_a_rise_that_keeps_nine_tenths_of_itself_over_four_answers_is_unbroken(share: float, accelerates: bool) -> None:
    assert (ACCELERATES in verdicts([10.0 + 50.0 * (1.0 - share ** (k / 4)) for k in range(60)])) is accelerates


def test_a_speed_that_rose_and_falls_again_or_stays_is_a_transient() -> None:
    assert ACCELERATES not in verdicts([13.0 - 0.01 * k for k in range(50)])
    assert ACCELERATES not in verdicts([13.0 + 0.9 * 4 * COUNT * (k > 2) for k in range(50)])


def test_old_answers_and_an_unknown_ramp_tell_nothing() -> None:
    assert ACCELERATES not in verdicts([10.0 + k for k in range(20)], fresh=False)
    assert ACCELERATES not in verdicts([10.0 + k for k in range(20)], ramp=0.0)
    assert ACCELERATES not in verdicts([10.0 + k for k in range(20)], ramp=float("inf"))


def test_the_highest_speed_before_the_stop_counts() -> None:
    watch = StopWatch(0.001, 3)
    for speed in (10.0, 20.0, 15.0):
        watch.step(StopAnswer(speed, COUNT, enabled=True, fresh=True), RAMP)
    found = [watch.step(StopAnswer(12.0 + k, COUNT, enabled=False, fresh=True), RAMP) for k in range(20)]
    assert found.index(ACCELERATES) == 11  # 23 rad/s is beyond 22.04


def test_the_answer_that_reports_the_stop_tells_of_the_period_before() -> None:
    found = verdicts([13.0 + 0.3 * k for k in range(20)], top=17.0)
    assert ACCELERATES not in found[:14]
    watch = StopWatch(0.001, 3)
    for speed, enabled in ((10.0, True), (17.0, False), *((13.0 + 0.3 * k, False) for k in range(14))):
        assert watch.step(StopAnswer(speed, COUNT, enabled=enabled, fresh=True), RAMP) is GOES_ON


def test_an_acceleration_is_said_once_and_then_has_the_time_of_an_answer() -> None:
    found = verdicts([10.0 + k for k in range(30)])
    assert found.count(ACCELERATES) == 1
    assert found.index(LATE) == found.index(ACCELERATES) + 10


def test_a_reset_forgets_the_stop_before() -> None:
    watch = StopWatch(0.001, 3)
    for k in range(30):
        watch.step(StopAnswer(10.0 + k, COUNT, enabled=False, fresh=True), RAMP)
    watch.reset()
    found = [watch.step(StopAnswer(10.0 + k, COUNT, enabled=False, fresh=True), RAMP) for k in range(10)]
    assert found[-1] is ACCELERATES


# -- on the drive -----------------------------------------------------------------------------------------------------


def turning() -> Rig:
    """Enabled, turning, and from now on with torque of the wrong sign."""
    rig = in_process(servo=servo(), settings=DriveSettings(quick_stop_rad_s2=100.0))
    rig.set_up()
    rig.enable()
    for _ in range(50):
        rig.cycle(0.4)
    rig.cycle(0.0)
    advance = rig.plant.advance
    rig.plant.advance = lambda torque_n_m, period_s: advance(-torque_n_m, period_s)
    rig.drive.goal = DriveGoal.QUICK_STOP
    return rig


def controlwords(rig: Rig) -> list[int]:
    sent: list[int] = []
    rig.node_port.listen(0x205, lambda can_id, data, now_s: sent.append(data[0]))
    return sent


@pytest.mark.parametrize("goal", [DriveGoal.QUICK_STOP, DriveGoal.DISABLED])
def test_a_ramp_that_accelerates_is_ended_by_disable_voltage(goal: DriveGoal) -> None:
    rig = turning()
    sent, speed_rad_s = controlwords(rig), rig.plant.velocity_rad_s
    for _ in range(100):
        sample = rig.cycle()
        if sample.condition & Condition.RUNAWAY:
            rig.drive.goal = goal  # a loop that ends meanwhile
    assert sample.state == DriveState.SWITCH_ON_DISABLED
    assert rig.drive.tripped & Condition.RUNAWAY
    assert not rig.master.silent
    assert abs(rig.plant.velocity_rad_s) < speed_rad_s + 20.0
    assert set(sent[sent.index(0) :]) == {0}  # nothing but "disable voltage" from then on


def test_a_drive_that_ignores_disable_voltage_gets_silence() -> None:
    rig = turning()
    for _ in range(3):
        rig.cycle()
    rig.node._take_controlword = lambda now_s: None
    rig.node.communication_lost = lambda now_s: None
    sent = controlwords(rig)
    cycles = next(k for k in range(200) if rig.cycle() and rig.master.silent)
    assert cycles - sent.index(0) in (9, 10)
    assert rig.drive.tripped & Condition.RUNAWAY
    assert rig.drive.read(rig.now_s).condition & Condition.UNANSWERED


def test_after_a_reset_the_drive_can_be_enabled_again() -> None:
    rig = turning()
    for _ in range(100):
        rig.cycle()
    rig.drive.reset_fault()
    del rig.plant.advance
    assert rig.drive.tripped is Condition.OK
    assert rig.enable().enabled
