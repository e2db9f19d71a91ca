"""The table of rules: which sign gives which rule, how the axis is stopped, which finding comes first."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bench_runs import bench_with

from drivers.port import Condition
from hil.loop.devices import Rig
from hil.loop.limits import Limit
from hil.loop.stall import Stall
from hil.loop.supervision import RULES, Ending, LoopSign, Reaction, StopCause, find, rules_table

FINE = Condition.LATE | Condition.BUS_PASSIVE  # what stops nothing


@pytest.fixture
def rig() -> Iterator[Rig]:
    with Rig(bench_with()) as rig:
        yield rig


def found(rig: Rig, passed: Limit = Limit.NONE, lateness_s: float = 0.0, stops_asked: int = 0, *,
          seen: Condition = Condition.OK, stopping: bool = False, **stall: Any) -> list[StopCause]:  # fmt: skip
    encoder = Rig(bench_with()).encoder if rig.encoder is None else rig.encoder
    sample = encoder.read(0.0)._replace(condition=seen)
    return list(find(rig, sample, passed, lateness_s, stops_asked, stopping=stopping, **stall))


def test_every_limit_has_one_rule() -> None:
    limits = [rule.limit for rule in RULES if rule.limit]
    assert sorted(limits) == sorted(limit for limit in Limit if limit)
    assert len({rule.name for rule in RULES}) == len(RULES)


def test_each_bit_gives_its_own_rule() -> None:
    rig = Rig(bench_with())
    try:
        seen = rig.encoder.read(0.0)._replace(condition=Condition.OK)
        for rule in RULES:
            if rule.limit:
                causes = list(find(rig, seen, rule.limit, 0.0, 0, stopping=False))
                assert [cause.rule for cause in causes] == [rule.name]
    finally:
        rig.close()


def test_document_and_table_agree() -> None:
    text = (Path(__file__).parents[3] / "docs" / "supervision.md").read_text(encoding="utf-8")
    assert rules_table() in text


def test_signs_of_the_loop_are_bits() -> None:
    assert [sign.value for sign in LoopSign.__members__.values()] == [0, 1, 2, 4]


def test_nothing_is_found_where_nothing_is_wrong(rig: Rig) -> None:
    assert found(rig) == []
    assert found(rig, seen=FINE) == []
    assert found(rig, lateness_s=rig.late_limit_s) == []


@pytest.mark.parametrize("rule", [rule for rule in RULES if rule.drive], ids=lambda rule: rule.name)
def test_each_condition_of_the_drive_is_a_quick_stop(rig: Rig, rule: Any) -> None:
    rig.drive.tripped = rule.drive
    (cause,) = found(rig)
    assert (cause.rule, cause.ending, cause.quick) == (rule.name, Ending.DRIVE_FAULT, True)
    assert str(rule.drive.name) in cause.reason
    rig.drive.tripped = FINE
    assert found(rig) == []


@pytest.mark.parametrize("feedback", ["motor", "table"])
@pytest.mark.parametrize("rule", [rule for rule in RULES if rule.encoder], ids=lambda rule: rule.name)
def test_each_condition_of_the_table_encoder(feedback: str, rule: Any) -> None:
    with Rig(bench_with(control={"position_feedback": feedback})) as rig:
        (cause,) = found(rig, seen=rule.encoder | FINE)
        assert (cause.rule, cause.ending) == (rule.name, Ending.ENCODER_FAULT)
        assert cause.quick == (feedback == "table")
        assert cause.reason == "it recovered by itself"  # the encoder itself reports nothing


def test_a_bench_without_a_table_encoder_has_no_conditions_of_one() -> None:
    with Rig(bench_with(encoders={"table": None})) as rig:
        assert found(rig, seen=Condition.ALARM) == []


@pytest.mark.parametrize("rule", [rule for rule in RULES if rule.limit], ids=lambda rule: rule.name)
@pytest.mark.parametrize("stopping", [False, True])
def test_reaction_to_each_limit(rig: Rig, rule: Any, stopping: bool) -> None:
    """Fed back by the motor encoder; a following error during a controlled stop leaves the stop to the drive."""
    (cause,) = found(rig, rule.limit, stopping=stopping)
    by_drive = rule.reaction is Reaction.QUICK_STOP or (rule.reaction is Reaction.TWICE and stopping)
    assert cause.quick == by_drive


def test_a_late_loop_is_told_with_its_lateness_and_stops_under_control(rig: Rig) -> None:
    (cause,) = found(rig, lateness_s=rig.late_limit_s + 0.001, stopping=True)
    assert (cause.rule, cause.quick) == ("loop late", False)
    assert f"the loop was {rig.late_limit_s + 0.001:.3f} s late, allowed {rig.late_limit_s:.3f} s" in cause.reason


@pytest.mark.parametrize(("asked", "stopping", "quick"), [
    (1, False, False), (1, True, False), (2, False, True), (2, True, True), (3, True, True)])  # fmt: skip
def test_the_second_request_is_a_quick_stop(rig: Rig, asked: int, stopping: bool, quick: bool) -> None:
    """The first one is none, also while the axis is stopped already for another reason."""
    (cause,) = found(rig, stops_asked=asked, stopping=stopping)
    assert (cause.ending, cause.quick) == (Ending.INTERRUPTED, quick)


def test_all_that_holds_is_found_the_gravest_first(rig: Rig) -> None:
    rig.drive.tripped = Condition.FAULT
    causes = found(rig, Limit.TRAVEL | Limit.VELOCITY, lateness_s=1.0, stops_asked=1, seen=Condition.ALARM)
    assert [cause.rule for cause in causes] == [
        "loop late", "drive fault", "table encoder alarm", "velocity", "travel", "stop asked"]  # fmt: skip


# -- after a stall ----------------------------------------------------------------------------------------------------


def after(rig: Rig, share: float, bound_m: float) -> dict[str, Stall]:
    return {"stall": Stall(0.03, share * bound_m, 0)}


@pytest.mark.parametrize("stopping", [False, True])
def test_a_stall_explains_what_it_moved_the_axis_by_a_fifth_of(rig: Rig, stopping: bool) -> None:
    error_m = rig.section.following_error_m
    causes = found(rig, Limit.FOLLOWING_ERROR, stopping=stopping, **after(rig, 0.2, error_m))
    assert [cause.rule for cause in causes] == ["after a stall", "following error"]
    assert causes[0].quick == stopping
    assert found(rig, Limit.FOLLOWING_ERROR, **after(rig, 0.199, error_m))[0].rule == "following error"
    assert found(rig, **after(rig, 10.0, error_m)) == []  # a stall alone is no reason


@pytest.mark.parametrize("residual_m", [{"motor_m": 1e-4, "table_m": 2e-4}, {"motor_m": 2e-4, "table_m": 1e-4},
                                        {"motor_m": 1e-4, "table_m": None}])  # fmt: skip
def test_a_residual_is_explained_by_a_share_of_its_own_threshold(residual_m: dict[str, float | None]) -> None:
    with Rig(bench_with(drive={"supervision": {"residual": {**residual_m, "torque": 1.0}}})) as rig:
        for limit in (Limit.RESIDUAL_LOAD, Limit.RESIDUAL_DRIVE, Limit.RESIDUAL_ENCODER):
            assert found(rig, limit, **after(rig, 0.21, 1e-4))[0].ending is Ending.OVERRUN
            assert found(rig, limit, **after(rig, 0.19, 1e-4))[0].ending is Ending.RESIDUAL
        assert found(rig, Limit.TRAVEL, **after(rig, 0.21, 1e-4))[0].ending is Ending.TRAVEL_LIMIT
        assert found(rig, Limit.TRAVEL, **after(rig, 0.21, rig.section.following_error_m))[0].ending is Ending.OVERRUN


def test_a_stall_explains_bounds_of_the_motion_and_none_of_a_sensor(rig: Rig) -> None:
    """A missing set-point breaks those of motion and torque; an encoder does not jump, freeze or count wrong by it."""
    moved = after(rig, 1.0, rig.section.following_error_m)
    explained = {limit for limit in Limit if limit and found(rig, limit, **moved)[0].rule == "after a stall"}
    of_sensors = Limit.NOT_FINITE | Limit.ENCODER_DIFFERENCE | Limit.TORQUE_TIME | Limit.SIGN | Limit.STOP_FAILS
    for encoder in ("MOTOR", "TABLE"):
        of_sensors |= Limit[f"{encoder}_JUMP"] | Limit[f"{encoder}_FROZEN"] | Limit[f"{encoder}_REVERSED"]
    assert explained == set(Limit) - set(of_sensors) - {Limit.NONE}


def test_a_stall_explains_no_fault_of_a_device(rig: Rig) -> None:
    moved = after(rig, 1.0, rig.section.following_error_m)
    assert found(rig, Limit.FOLLOWING_ERROR | Limit.MOTOR_JUMP, **moved)[0].rule == "motor encoder jump"
    assert found(rig, Limit.FOLLOWING_ERROR, seen=Condition.ALARM, **moved)[0].rule == "table encoder alarm"
    rig.drive.tripped = Condition.FAULT
    assert found(rig, Limit.FOLLOWING_ERROR, **moved)[0].rule == "drive fault"
