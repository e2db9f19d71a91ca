"""Each bound of the compiled checks alone: up to which value it holds, after how many ticks it is passed."""

from __future__ import annotations

import math
from itertools import repeat

import pytest
from checked_ticks import PERIOD_S, STILL, Checked

from hil.loop.limits import Limit, Memory

BOTH = pytest.mark.parametrize("sign", [1.0, -1.0])
AT, BEYOND = 1.0, 1.0 + 1e-9  # shares of a bound


def test_limits_are_bits_and_memory_has_no_gap() -> None:
    assert [limit.value for limit in Limit.__members__.values()] == [0, *(1 << k for k in range(len(Limit)))]
    assert [place.value for place in Memory.__members__.values()] == list(range(len(Memory)))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["position_m", "motor_m", "table_m", "torque", "command", "reference", "twin_motor_m",
                                  "twin_table_m", "twin_torque"])  # fmt: skip
def test_a_value_that_is_no_number(name: str, value: float) -> None:
    assert Checked().tick(**{name: value}) == Limit.NOT_FINITE


def test_values_that_cancel_are_numbers() -> None:
    """A sum of signed values would hide an infinity, and a large value is none."""
    assert Checked().tick(position_m=math.inf, motor_m=-math.inf) == Limit.NOT_FINITE
    assert Checked().tick(torque=1e300, command=-1e300) == Limit.NONE


@BOTH
@pytest.mark.parametrize(("speed_m_s", "allowed_m"), [(0.0, 2**-10), (0.25, 3 * 2**-10), (-0.25, 3 * 2**-10)])
def test_following_error_grows_with_speed(sign: float, speed_m_s: float, allowed_m: float) -> None:
    checked = Checked(following_error_m=2**-10, following_error_s=2**-7)
    for share, expected in ((AT, Limit.NONE), (BEYOND, Limit.FOLLOWING_ERROR)):
        away_m = sign * share * allowed_m
        assert checked.tick(position_m=0.5 + away_m, fed_back_m=0.5, velocity_m_s=speed_m_s) == expected


@pytest.mark.parametrize(("position_m", "passed"), [
    (-0.1, Limit.NONE), (0.3, Limit.NONE), (-0.1001, Limit.TRAVEL), (0.3001, Limit.TRAVEL)])  # fmt: skip
def test_travel_has_two_ends(position_m: float, passed: Limit) -> None:
    checked = Checked(travel_low_m=-0.1, travel_high_m=0.3, following_error_m=1.0)
    assert checked.tick(fed_back_m=position_m) == passed


@BOTH
@pytest.mark.parametrize(("encoder", "limit"), [("motor", Limit.MOTOR_JUMP), ("table", Limit.TABLE_JUMP)])
def test_a_jump_is_further_than_the_axis_can_move_since_the_last_sample(
    sign: float, encoder: str, limit: Limit
) -> None:
    """0.5 m/s x time + 0.2 mm: time of one period, of three with two late samples, of five with four ticks left out."""
    frozen_m = 2**-12
    for late, skipped, periods in ((0, 0, 1), (2, 0, 3), (0, 4, 5), (2, 4, 7)):
        allowed_m = 0.5 * periods * PERIOD_S + frozen_m
        for share, expected in ((AT, Limit.NONE), (BEYOND, limit)):
            checked = Checked(velocity_m_s=0.5, frozen_m=frozen_m)
            for _ in range(late):
                assert checked.tick(**{f"{encoder}_age": 1, f"{encoder}_m": 0.0}) == Limit.NONE
            jump = {f"{encoder}_m": sign * share * allowed_m, "skipped": skipped}
            other = {f"{'table' if encoder == 'motor' else 'motor'}_age": 1}  # nothing is compared with it
            assert checked.tick(**jump, **other) == expected
            assert checked.tick(**jump, **other) == Limit.NONE  # it does not jump again


def test_time_left_out_counts_once() -> None:
    checked = Checked(velocity_m_s=0.5, frozen_m=0.2e-3)
    assert checked.tick(skipped=100) == Limit.NONE
    assert checked.tick(motor_m=0.8e-3, table_age=1, skipped=100) == Limit.MOTOR_JUMP
    assert checked.tick(motor_age=1, table_m=0.8e-3, skipped=100) == Limit.NONE  # it was late in the tick before
    assert checked.tick(motor_age=1, table_m=1.6e-3, skipped=100) == Limit.TABLE_JUMP


def test_without_a_table_encoder_nothing_is_compared_with_it() -> None:
    checked = Checked(has_table=False, velocity_m_s=0.5, frozen_m=0.2e-3, encoder_difference_m=1e-3)
    assert checked.tick(table_m=1.0) == Limit.NONE


@BOTH
def test_velocity_is_smoothed_over_eight_ticks(sign: float) -> None:
    """After k ticks of 0.6 m/s the smoothed velocity is 0.6 (1 - (7/8)^k) m/s; the rule promises 16."""
    moving = [{"motor_m": sign * 0.6 * PERIOD_S * k, "table_age": 1} for k in range(1, 100)]
    expected = math.ceil(math.log(1 - 0.5 / 0.6) / math.log(7 / 8))
    assert Checked(velocity_m_s=0.5).ticks_until_passed(moving) == (expected, Limit.VELOCITY)
    assert expected <= 16
    assert Checked(velocity_m_s=0.61).ticks_until_passed(moving) == (0, Limit.NONE)


@BOTH
def test_a_step_of_one_tick_counts_an_eighth(sign: float) -> None:
    """For the velocity, and for the way of a stop: (1/16 m/s)^2 / (2 x 1/8 m/s^2) = 1/64 m."""
    step = {"motor_m": sign * 0.5 * PERIOD_S, "table_age": 1}
    assert Checked(velocity_m_s=0.0625, frozen_m=1.0).tick(**step) == Limit.NONE
    assert Checked(velocity_m_s=0.0624, frozen_m=1.0).tick(**step) == Limit.VELOCITY
    bounds = {"deceleration_m_s2": 0.125, "following_error_m": 2**-7, "travel_low_m": -(2**-7)}
    assert Checked(**bounds, travel_high_m=2**-7).tick(**step) == Limit.NONE
    tight = bounds | {"travel_low_m": -(2**-7) + 1e-9, "travel_high_m": 2**-7 - 1e-9}
    assert Checked(**tight).tick(**step) == Limit.STOPPING_DISTANCE


def test_velocity_after_late_samples_is_the_way_over_the_whole_time() -> None:
    checked = Checked(velocity_m_s=0.5)
    for k in range(1, 200):
        age = k % 4
        assert checked.tick(motor_m=0.45 * PERIOD_S * (k - age), motor_age=age) == Limit.NONE


@BOTH
def test_the_way_of_a_stop_must_end_inside_the_travel(sign: float) -> None:
    """0.4 m/s with 2 m/s^2 take 40 mm; 1 mm more is allowed."""
    ends = (-0.1, 0.3) if sign > 0 else (-0.3, 0.1)
    checked = Checked(travel_low_m=ends[0], travel_high_m=ends[1], deceleration_m_s2=2.0, following_error_m=1e-3)
    step_m = 0.4 * PERIOD_S
    moving = [{name: sign * step_m * k for name in ("motor_m", "fed_back_m", "position_m")} for k in range(1, 1000)]
    count, passed = checked.ticks_until_passed(moving)
    assert passed == Limit.STOPPING_DISTANCE
    assert count == math.floor((0.3 + 1e-3 - 0.04) / step_m) + 1


@BOTH
def test_torque_three_times_in_a_row(sign: float) -> None:
    checked = Checked(torque=10.0)
    beyond, below = sign * 10.01, sign * 10.0
    passed = [checked.tick(torque=torque) for torque in (beyond, beyond, below, beyond, beyond, beyond, beyond, below)]
    assert passed == [Limit.NONE] * 5 + [Limit.TORQUE] * 2 + [Limit.NONE]


@BOTH
def test_torque_over_time_is_a_mean_square(sign: float) -> None:
    """1.25 times the continuous torque: 1.25^2 (1 - exp(-t / T)) = 1 at t = 1.02 T."""
    checked = Checked(continuous_torque=4.0, thermal_time_s=0.5)
    count, passed = checked.ticks_until_passed(repeat({"torque": sign * 5.0}, 2000))
    assert passed == Limit.TORQUE_TIME
    assert count * PERIOD_S == pytest.approx(-0.5 * math.log(1.0 - 1.0 / 1.25**2), abs=2 * PERIOD_S)
    assert Checked(continuous_torque=4.0).ticks_until_passed(repeat({"torque": 3.99}, 9000)) == (0, Limit.NONE)


@BOTH
def test_torque_that_differs_from_its_command(sign: float) -> None:
    """Smoothed as the velocity: 4 (1 - (7/8)^k) > 3 for k = 11."""
    values = {"torque": sign * 5.0, "command": sign * 1.0}
    first = STILL._replace(torque=sign * 1.0, command=sign * 1.0)
    assert Checked(first, torque_difference=3.0).ticks_until_passed(repeat(values, 99)) == (11, Limit.ACTING_TORQUE)
    assert Checked(first, torque_difference=4.1).ticks_until_passed(repeat(values, 99)) == (0, Limit.NONE)
    in_drive = Checked(first, torque_difference=3.0, commands_torque=False)  # CSV, CSP: the command is no torque
    assert in_drive.ticks_until_passed(repeat(values, 99)) == (0, Limit.NONE)
    late = Checked(first, torque_difference=3.0)
    assert late.ticks_until_passed(repeat({**values, "motor_age": 1}, 99)) == (0, Limit.NONE)


@BOTH
def test_a_command_is_measured_a_tick_later_and_limited_by_the_drive(sign: float) -> None:
    checked, before = Checked(torque_difference=0.01, drive_torque=8.0), 0.0
    for k in range(1, 200):
        command = sign * (k % 12)
        assert checked.tick(torque=max(-8.0, min(8.0, before)), command=command) == Limit.NONE
        before = command


RESIDUAL = {"residual_motor_m": 1e-4, "residual_table_m": 2e-4, "residual_torque": 1.0}


@pytest.mark.parametrize(
    ("values", "limit"),
    [
        ({"twin_motor_m": 1.1e-4}, Limit.RESIDUAL_ENCODER),
        ({"twin_motor_m": -1.1e-4}, Limit.RESIDUAL_ENCODER),
        ({"twin_table_m": 2.2e-4}, Limit.RESIDUAL_ENCODER),
        ({"twin_motor_m": 0.5e-4, "twin_table_m": 2.2e-4, "twin_torque": 0.5}, Limit.RESIDUAL_ENCODER),
        ({"twin_motor_m": 0.51e-4, "twin_table_m": 2.2e-4}, Limit.RESIDUAL_LOAD),  # both positions
        ({"twin_motor_m": 1.1e-4, "twin_table_m": 1.02e-4}, Limit.RESIDUAL_LOAD),
        ({"twin_motor_m": 1.1e-4, "twin_torque": 0.51}, Limit.RESIDUAL_LOAD),
        ({"twin_torque": 1.1}, Limit.RESIDUAL_LOAD),
        ({"twin_torque": -1.1}, Limit.RESIDUAL_LOAD),
        ({"twin_torque": 1.1, "command": 1.1}, Limit.RESIDUAL_DRIVE),
        ({"twin_motor_m": 1.1e-4, "command": -1.1}, Limit.RESIDUAL_DRIVE),
        ({"twin_torque": 1.1, "command": 1.0}, Limit.RESIDUAL_LOAD),
        ({"twin_motor_m": 1e-4, "twin_table_m": 2e-4, "twin_torque": 1.0}, Limit.NONE),
    ],
)
def test_residual_of_the_twin_names_a_suspect_after_twenty_ticks(values: dict[str, float], limit: Limit) -> None:
    """Command and torque of the twin act until the next tick, so that the first of these ticks shows positions only."""
    checked = Checked(**RESIDUAL)
    checked.tick(**{name: value for name, value in values.items() if name in ("command", "twin_torque")})
    assert checked.ticks_until_passed(repeat(values, 60)) == ((20, limit) if limit else (0, Limit.NONE))


def test_a_residual_must_last_and_be_of_fresh_samples() -> None:
    beyond, inside, late = {"twin_table_m": 2.2e-4}, {}, {"twin_table_m": 2.2e-4, "table_age": 1}
    ticks = [*repeat(beyond, 19), inside, *repeat(beyond, 19), late, beyond]
    assert Checked(**RESIDUAL).ticks_until_passed(ticks) == (41, Limit.RESIDUAL_ENCODER)
    assert Checked(**RESIDUAL).ticks_until_passed(repeat(beyond | {"motor_age": 1}, 99)) == (0, Limit.NONE)


def test_a_residual_is_the_distance_of_axis_and_twin_wherever_they_are() -> None:
    where = {"motor_m": 0.1, "table_m": 0.3, "torque": 3.0}
    twin = {"twin_motor_m": 0.1, "twin_table_m": 0.3, "twin_torque": 3.0, "command": 3.0}
    assert Checked(STILL._replace(**where, **twin), **RESIDUAL).ticks_until_passed(repeat({}, 60)) == (0, Limit.NONE)


def test_a_residual_is_told_as_long_as_it_lasts() -> None:
    checked = Checked(**RESIDUAL)
    passed = [checked.tick(twin_table_m=2.2e-4) for _ in range(30)]
    assert passed == [Limit.NONE] * 19 + [Limit.RESIDUAL_ENCODER] * 11
    assert checked.tick() == Limit.NONE


def test_a_drive_with_loops_of_its_own_is_not_suspected_for_a_torque_that_was_not_commanded() -> None:
    checked = Checked(commands_torque=False, **RESIDUAL | {"residual_torque": 0.5})
    checked.tick(twin_torque=1.1, command=5.0)
    ticks = repeat({"twin_torque": 1.1, "command": 5.0}, 60)
    assert checked.ticks_until_passed(ticks) == (20, Limit.RESIDUAL_LOAD)


def test_without_a_table_encoder_the_load_is_the_suspect() -> None:
    checked = Checked(has_table=False, **RESIDUAL | {"residual_table_m": math.inf})
    assert checked.ticks_until_passed(repeat({"twin_motor_m": 1.1e-4}, 60)) == (20, Limit.RESIDUAL_LOAD)
