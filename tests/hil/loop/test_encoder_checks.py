"""Comparison of the two encoders and of the motor encoder with the torque, tick by tick, without devices."""

from __future__ import annotations

import pytest
from checked_ticks import STILL, Checked

from hil.loop.limits import Limit

STEP_M = 2.0**-17  # a tick: 8 mm/s
FROZEN_M = 2.0**-12
BOTH = pytest.mark.parametrize("sign", [1.0, -1.0])


def moving(ticks: int, sign: float = 1.0, **others: float) -> list[dict[str, float]]:
    """Ticks in which set-point, motor and table move alike, but for those that are given."""
    names = ("position_m", "motor_m", "table_m", "fed_back_m")
    return [dict.fromkeys(names, sign * k * STEP_M) | others for k in range(1, ticks + 1)]


@BOTH
@pytest.mark.parametrize(("turned", "found"), [("motor", Limit.MOTOR_REVERSED), ("table", Limit.TABLE_REVERSED)])
def test_an_encoder_that_turns_round_in_motion_is_found_where_it_turned(sign: float, turned: str, found: Limit) -> None:
    """After 15 mm in which both agreed: the way since then counts, not the way since the start. The table is 2 % ahead
    or behind there: that is no other direction."""
    checked = Checked(frozen_m=FROZEN_M)
    ahead = [tick | {"table_m": 1.02 * tick["motor_m"]} for tick in moving(900, sign)]
    behind = [tick | {"table_m": tick["motor_m"] + sign * 18 * STEP_M * (1900 - k) / 1000}
              for k, tick in enumerate(moving(1900, sign)[900:], 901)]  # fmt: skip
    assert checked.ticks_until_passed([*ahead, *behind]) == (0, Limit.NONE)
    turn = moving(1900, sign)[-1]["motor_m"]
    back = [there | {f"{turned}_m": 2.0 * turn - there[f"{turned}_m"]} for there in moving(2300, sign)[1900:]]
    count, passed = checked.ticks_until_passed(back)
    assert passed == found
    assert FROZEN_M < count * STEP_M <= 2.0 * FROZEN_M + 10 * STEP_M  # the speed of both adds to the bound


@BOTH
@pytest.mark.parametrize(("frozen", "found"), [("motor", Limit.MOTOR_FROZEN), ("table", Limit.TABLE_FROZEN)])
def test_an_encoder_is_frozen_if_the_other_moves_on(sign: float, frozen: str, found: Limit) -> None:
    """The samples may be two periods apart, which adds two steps to the bound where the motor is seen to move."""
    checked = Checked(frozen_m=FROZEN_M)
    assert checked.ticks_until_passed(moving(500, sign)) == (0, Limit.NONE)
    stands = moving(500, sign)[-1][f"{frozen}_m"]
    ticks = [tick | {f"{frozen}_m": stands} for tick in moving(600, sign)[500:]]
    count, passed = checked.ticks_until_passed(ticks)
    assert passed == found
    apart_m = 2.0 * STEP_M if frozen == "table" else 0.0
    assert count * STEP_M == pytest.approx(FROZEN_M + apart_m, abs=1.01 * STEP_M)


@pytest.mark.parametrize("late", ["motor", "table"])
def test_a_late_sample_is_not_compared(late: str) -> None:
    checked = Checked(frozen_m=FROZEN_M, encoder_difference_m=1e-3)
    ticks = moving(500, **{f"{late}_m": 0.0, f"{late}_age": 1})
    assert checked.ticks_until_passed(ticks) == (0, Limit.NONE)


@BOTH
def test_encoders_may_differ_by_their_zeros_and_not_by_their_travel(sign: float) -> None:
    """One that scales wrong by a half, from a zero that is 0.2 m away: 1 mm and two periods of the motor's speed."""
    checked = Checked(STILL._replace(table_m=0.2), encoder_difference_m=1e-3)
    ticks = [tick | {"table_m": 0.2 + 0.5 * tick["motor_m"]} for tick in moving(1000, sign)]
    count, passed = checked.ticks_until_passed(ticks)
    assert passed == Limit.ENCODER_DIFFERENCE
    assert 0.5 * count * STEP_M == pytest.approx(1e-3 + 2.0 * STEP_M, abs=1.01 * STEP_M)


@BOTH
def test_an_axis_that_stands_may_quiver(sign: float) -> None:
    """Each encoder by less than the bound, against the other and against the set-point."""
    checked = Checked(frozen_m=FROZEN_M, encoder_difference_m=1e-3)
    for k in range(400):
        quiver_m = sign * 0.45 * FROZEN_M * (-1) ** k
        assert checked.tick(motor_m=quiver_m, table_m=-quiver_m, position_m=-quiver_m) == Limit.NONE


@BOTH
def test_a_motor_encoder_is_frozen_against_the_torque_that_acts_and_not_against_its_command(sign: float) -> None:
    values = {"command": 2.1 * sign}
    for torque, expected in ((0.0, Limit.NONE), (2.0, Limit.NONE), (2.01, Limit.MOTOR_FROZEN)):
        assert Checked(frozen_torque=2.0).tick(**values, torque=sign * torque) == expected
        assert Checked(frozen_torque=2.0, commands_torque=False).tick(**values, torque=sign * torque) == Limit.NONE
        assert Checked(frozen_torque=2.0).tick(**values, torque=sign * torque, motor_age=1) == Limit.NONE


def test_the_torque_counts_since_the_motor_encoder_changed() -> None:
    checked = Checked(frozen_torque=2.0)
    for k in range(1, 100):
        assert checked.tick(motor_m=k * STEP_M, torque=0.1 * k) == Limit.NONE
    assert checked.tick(motor_m=99 * STEP_M, torque=9.9 + 1.99) == Limit.NONE
    assert checked.tick(motor_m=99 * STEP_M, torque=9.9 + 2.01) == Limit.MOTOR_FROZEN


@BOTH
@pytest.mark.parametrize(
    ("name", "motor", "table", "found"),
    [
        ("frozen_m", 1.0, 0.0, Limit.TABLE_FROZEN),
        ("frozen_m", 1.0, -1.0, Limit.TABLE_REVERSED),
        ("encoder_difference_m", 1.0, 0.0, Limit.ENCODER_DIFFERENCE),
    ],
)
def test_the_bound_and_the_way_of_two_periods_may_be_reached(
    sign: float, name: str, motor: float, table: float, found: Limit
) -> None:
    """A step of 2^-12 m: the smoothed velocity is an eighth of it, two periods of that a quarter of the step."""
    step_m = sign * 2.0**-12
    tick = {"position_m": step_m, "motor_m": motor * step_m, "table_m": table * step_m}
    assert Checked(**{name: 0.75 * 2.0**-12}).tick(**tick) == Limit.NONE
    assert Checked(**{name: 0.7499 * 2.0**-12}).tick(**tick) == found


@BOTH
def test_while_the_set_points_rest_the_motor_encoder_is_the_one_that_is_wrong(sign: float) -> None:
    """The position loop drives the axis away from resting set-points if the motor encoder counts the wrong way."""
    step_m = sign * 2.0**-12
    assert Checked(frozen_m=0.5 * 2.0**-12).tick(motor_m=step_m, table_m=-step_m) == Limit.MOTOR_REVERSED


@BOTH
def test_a_motor_encoder_that_stands_may_be_left_by_the_bound(sign: float) -> None:
    checked = Checked(frozen_m=FROZEN_M)
    ticks = [{"table_m": sign * k * STEP_M} for k in range(1, 100)]
    assert checked.ticks_until_passed(ticks) == (round(FROZEN_M / STEP_M) + 1, Limit.MOTOR_FROZEN)
