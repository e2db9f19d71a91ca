"""The plain model: exact on exact motion, in any unit, for either direction of the axis, with errors that cover."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.identification.derivatives import motion
from hil.identification.plain_model import (
    MOTION,
    MotionData,
    PlainModel,
    fit_plain_model,
    motion_data,
    plain_columns,
)
from hil.identification.windows import position_noise, quiet_window

PERIOD_S = 1e-3
TIME = np.arange(8000) * PERIOD_S
TURN = 0.8 * np.sin(2.0 * np.pi * 0.37 * TIME) + 0.3 * np.sin(2.0 * np.pi * 0.91 * TIME + 1.0)
VALUES = {"inertia": 0.02, "viscous": 0.1, "coulomb": 0.7, "offset": -0.2}
POSITIVE, ANY = st.floats(0.05, 5.0), st.floats(-5.0, 5.0)


def exact(position: FloatArray, load_ratio: float | None = None, **values: float) -> MotionData:
    """Data whose torque is that of the plain model with values on the smoothed motion."""
    found = motion_data(position, np.zeros(position.size), PERIOD_S)
    columns = plain_columns(found.moved, load_ratio, spring=True)
    torque = np.sum([value * columns[name] for name, value in values.items()], axis=0)
    return replace(found, torque=torque)


def fitted(
    position: FloatArray, torque: FloatArray, load_ratio: float | None = None, period_s: float = PERIOD_S
) -> PlainModel:
    found = fit_plain_model([motion_data(position, torque, period_s)], load_ratio, spring=True)
    assert found is not None
    return found


def torque_of(position: FloatArray) -> FloatArray:
    moved = motion(position, PERIOD_S)
    return np.asarray(sum(VALUES[name] * column for name, column in plain_columns(moved).items()))


@given(POSITIVE, POSITIVE, POSITIVE, ANY)
@settings(max_examples=15)
def test_exact_motion_gives_back_its_values(inertia: float, viscous: float, coulomb: float, offset: float) -> None:
    values = dict(zip(MOTION, (inertia, viscous, coulomb, offset), strict=True))
    model = fit_plain_model([exact(TURN, **values)])
    assert model is not None
    for name, value in values.items():
        assert model[name].value == pytest.approx(value, abs=1e-9)
        assert model[name].std_error < 1e-9
    data = exact(TURN, **values)
    rows = data.sliding(model.slowest)
    assert np.count_nonzero(rows) > 6000
    np.testing.assert_allclose(model.predict(data.moved)[rows], data.torque[rows], atol=1e-9)


@given(POSITIVE, st.floats(0.5, 5.0), st.floats(-math.pi, math.pi))
@settings(max_examples=15)
def test_gravity_is_earned_by_a_load_that_turns(coulomb: float, size: float, angle: float) -> None:
    values = VALUES | {"coulomb": coulomb, "sine": size * math.cos(angle), "cosine": size * math.sin(angle)}
    heavy = exact(TURN, 1.5, **values)
    model = fit_plain_model([heavy], 1.5)
    assert model is not None
    if "sine" in model.fit.names:  # where it leaves clearly less
        assert {name: model[name].value for name in values} == pytest.approx(values, abs=1e-8)
    else:
        assert model.fit.left < 0.5


def test_an_axis_without_weight_has_none() -> None:
    torque = torque_of(TURN) + 0.01 * np.random.default_rng(1).normal(size=TURN.size)
    assert fitted(TURN, torque, 1.5).fit.names == MOTION


def test_a_load_that_turns_little_has_a_spring() -> None:
    little = exact(0.1 * TURN, 1.0, **VALUES, spring=9.0)
    model = fit_plain_model([little], 1.0, spring=True)
    assert model is not None
    assert model.fit.names == (*MOTION, "spring")
    assert model["spring"].value == pytest.approx(9.0)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.integers(0, 1000))
@settings(max_examples=15)
def test_values_and_errors_scale_with_the_units(length: float, force: float, seed: int) -> None:
    noise = 0.1 * np.random.default_rng(seed).normal(size=TURN.size)
    torque = torque_of(TURN) + noise
    first, other = fitted(TURN, torque), fitted(length * TURN, force * torque)
    scales = np.array([force / length, force / length, force, force])
    np.testing.assert_allclose(other.fit.values, scales * first.fit.values, rtol=1e-6, atol=1e-9 * force)
    np.testing.assert_allclose(other.fit.std_errors, scales * first.fit.std_errors, rtol=1e-6)
    assert other.fit.left == pytest.approx(first.fit.left)


@given(st.integers(0, 1000), ANY)
@settings(max_examples=15)
def test_an_axis_counted_the_other_way_has_the_same_values_and_the_opposite_load(seed: int, zero: float) -> None:
    torque = torque_of(TURN) + 0.1 * np.random.default_rng(seed).normal(size=TURN.size)
    first, turned = fitted(TURN, torque), fitted(zero - TURN, -torque)
    np.testing.assert_allclose(turned.fit.values, first.fit.values * [1, 1, 1, -1], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(turned.fit.std_errors, first.fit.std_errors, rtol=1e-6)


@pytest.mark.parametrize("wander", [0.0, 0.95])
def test_standard_errors_cover(wander: float) -> None:
    """White noise of the torque, and one that wanders: 95 of 100 within two errors, some less of ten blocks."""
    rng = np.random.default_rng(4)
    clean = torque_of(TURN)
    scores = []
    for _ in range(40):
        noise = rng.normal(size=TURN.size)
        for row in range(1, noise.size) if wander else ():
            noise[row] += wander * noise[row - 1]
        model = fitted(TURN, clean + 0.1 * noise)
        scores.append([(model[name].value - VALUES[name]) / model[name].std_error for name in MOTION])
    within = np.mean(np.abs(scores) < 2.0, axis=0)
    assert np.all(within > 0.88)
    assert np.all(np.std(scores, axis=0) > 0.5)  # and no error is much too large


@given(st.sampled_from((-1.0, 1.0)), POSITIVE, ANY)
@settings(max_examples=15)
def test_motion_one_way_tells_inertia_but_not_friction_from_a_load(way: float, coulomb: float, offset: float) -> None:
    position = way * (TIME + 0.1 * np.sin(2.0 * np.pi * 0.37 * TIME))
    values = VALUES | {"coulomb": coulomb, "offset": offset}
    model = fit_plain_model([exact(position, **values)])
    assert model is not None
    assert model["coulomb"].std_error == model["offset"].std_error == math.inf
    assert model["inertia"].value == pytest.approx(VALUES["inertia"], abs=1e-9)
    assert model["inertia"].std_error < 1e-6
    both = model["coulomb"].value * way + model["offset"].value
    assert both == pytest.approx(coulomb * way + offset, abs=1e-9)


def test_recordings_one_way_each_tell_together_what_neither_tells_alone() -> None:
    there, back = (exact(way * (TIME + 0.1 * np.sin(2.0 * TIME)), **VALUES) for way in (1.0, -1.0))
    model = fit_plain_model([there, back])
    assert model is not None
    assert {name: model[name].value for name in MOTION} == pytest.approx(VALUES, abs=1e-9)
    assert model["coulomb"].std_error < 1e-6


def test_rows_that_are_not_judged_count_for_nothing() -> None:
    torque = torque_of(TURN)
    torque[:2000] = 50.0
    data = motion_data(TURN, torque, PERIOD_S, slice(2100, None))
    model = fit_plain_model([data])
    assert model is not None
    assert model["coulomb"].value == pytest.approx(VALUES["coulomb"], rel=0.02)
    assert not data.rows[:2100].any()
    assert not data.sliding(model.slowest)[np.abs(data.moved.velocity) <= min(model.slowest)].any()


@pytest.mark.parametrize("position", [np.zeros(4000), TURN[:30]])
def test_rest_and_a_few_rows_tell_nothing(position: FloatArray) -> None:
    assert fit_plain_model([motion_data(position, np.ones(position.size), PERIOD_S)]) is None


def logged(speeds: list[float], period_s: float, mean: bool, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Rows of position and torque of stretches of 4 s at each speed, ramps of 0.4 s between: samples or means of a row.

    Each inner step of 1 ms by the equation of the plain model, with white noise.
    """
    stretches = [np.interp(np.arange(4400) * 1e-3, [0.0, 0.4], pair) for pair in pairwise([0.0, *speeds])]
    velocity = np.concatenate(stretches)
    acceleration, position = np.gradient(velocity, 1e-3), np.cumsum(velocity) * 1e-3
    inertia, viscous, coulomb, offset = VALUES.values()
    torque = inertia * acceleration + viscous * velocity + coulomb * np.sign(velocity) + offset
    torque += 0.02 * np.random.default_rng(seed).normal(size=torque.size)
    step = round(period_s / 1e-3)
    rows = [one[: one.size // step * step].reshape(-1, step) for one in (position, torque)]
    first, second = (one.mean(axis=1) if mean else one[:, 0] for one in rows)
    return first, second


BOTH_WAYS = [2.0, -2.0, 6.0, -6.0, 10.0, -10.0, 4.0, -4.0]


@pytest.mark.parametrize("period_s", [0.02, 0.05, 0.1, 0.3])
@pytest.mark.parametrize("mean", [False, True])
def test_slow_and_averaged_rows_tell_coulomb_from_viscous_friction(period_s: float, mean: bool) -> None:
    position, torque = logged(BOTH_WAYS, period_s, mean)
    model = fitted(position, torque, None, period_s)
    for name in ("viscous", "coulomb", "offset"):
        assert abs(model[name].value - VALUES[name]) < 4.0 * model[name].std_error
    for name in ("viscous", "coulomb"):
        assert model[name].value == pytest.approx(VALUES[name], rel=0.05)
        assert model[name].std_error < 0.05 * VALUES[name]
    # plain least squares on the rows whose neighbours move as fast
    speed = np.gradient(position, period_s)
    even = np.abs(speed[2:-2] - speed[:-4]) + np.abs(speed[2:-2] - speed[4:]) < 1e-3
    one = speed[2:-2][even]
    matrix = np.column_stack([np.sign(one), one, np.ones(one.size)])
    reference = np.linalg.lstsq(matrix, torque[2:-2][even], rcond=None)[0]
    np.testing.assert_allclose([model[name].value for name in ("coulomb", "viscous", "offset")], reference, atol=0.02)


def test_torque_that_is_a_mean_until_the_next_row_is_found_to_be_early() -> None:
    """Position sampled at the begin of rows of 20 ms, torque a mean over them."""
    time, step = np.arange(40_000) * 1e-3, 20
    position = 3.0 * np.sin(2.1 * time) + 1.5 * np.sin(5.3 * time)
    velocity = 6.3 * np.cos(2.1 * time) + 7.95 * np.cos(5.3 * time)
    acceleration = -13.23 * np.sin(2.1 * time) - 42.135 * np.sin(5.3 * time)
    torque = 0.02 * acceleration + 0.1 * velocity + 0.7 * np.sign(velocity)
    torque += 0.01 * np.random.default_rng(1).normal(size=time.size)
    model = fitted(position[::step], torque.reshape(-1, step).mean(axis=1), None, 0.02)
    assert model.early_rows == pytest.approx(0.5, abs=0.1)
    assert model["inertia"].value == pytest.approx(0.02, rel=0.02)
    assert model["coulomb"].value == pytest.approx(0.7, rel=0.02)


@pytest.mark.parametrize("late_s", [0.018, 0.03, -0.015])
def test_a_torque_that_is_late_by_more_than_its_window_is_found(late_s: float) -> None:
    """Rows of 5 ms. About each reversal the torque of the other way is still recorded."""
    step, time = 5, np.arange(60_000) * 1e-3
    velocity = 6.3 * np.cos(2.1 * time) + 7.95 * np.cos(5.3 * time)
    acceleration = -13.23 * np.sin(2.1 * time) - 42.135 * np.sin(5.3 * time)
    torque = 0.02 * acceleration + 0.1 * velocity + 0.7 * np.sign(velocity)
    recorded = np.interp(time - late_s, time, torque)[::step]
    recorded += 0.05 * np.random.default_rng(1).normal(size=recorded.size)
    position = (3.0 * np.sin(2.1 * time) + 1.5 * np.sin(5.3 * time))[::step]
    model = fitted(position, recorded, None, 0.005)
    assert model.early_rows == pytest.approx(-late_s / 0.005, abs=0.2)
    assert model["inertia"].value == pytest.approx(0.02, rel=0.02)
    assert model["coulomb"].value == pytest.approx(0.7, rel=0.02)


def test_one_speed_does_not_tell_coulomb_from_viscous_friction() -> None:
    data = []
    for way in (1.0, -1.0):
        position, torque = logged([way * 5.0], 0.1, mean=False)
        position += 1e-5 * np.random.default_rng(4).normal(size=position.size)
        data.append(motion_data(position[6:], torque[6:], 0.1))
    model = fit_plain_model(data)
    assert model is not None
    both = model["coulomb"].value + 5.0 * model["viscous"].value
    assert both == pytest.approx(VALUES["coulomb"] + 5.0 * VALUES["viscous"], rel=0.02)
    assert not model["coulomb"].significant
    assert not model["viscous"].significant
    assert model["offset"].value == pytest.approx(VALUES["offset"], rel=0.1)


def test_the_structure_is_earned() -> None:
    """Terms without effect are not kept for what they explain by chance, white or wandering."""
    rng = np.random.default_rng(2)
    position, clean = logged(BOTH_WAYS, 0.05, mean=False)
    kept = []
    for number in range(40):
        noise = rng.normal(size=clean.size)
        noise = lfilter([0.3], [1.0, -0.95], noise) if number % 2 else noise
        kept.append(fitted(position, clean + 0.2 * noise, 0.1, 0.05).fit.names)
    assert kept.count(MOTION) >= 39


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_an_axis_that_only_creeps_back_tells_friction_from_load(way: float) -> None:
    # 3 s there, rest, 2.5 s back at 1 % of the speed; torque and position with white noise
    speed = np.concatenate(
        [
            np.zeros(500),
            2.0 * np.sin(np.pi * TIME[:3000] / 3.0) ** 2,
            np.zeros(500),
            np.full(2500, -0.02),
            np.zeros(500),
        ]
    )
    position = way * np.cumsum(speed) * PERIOD_S
    rng = np.random.default_rng(3)
    torque = torque_of(position) + 0.02 * rng.standard_normal(position.size)
    model = fitted(position + 1e-6 * rng.standard_normal(position.size), torque)
    for name in ("coulomb", "offset"):
        assert model[name].value == pytest.approx(VALUES[name], abs=4.0 * model[name].std_error)
        assert model[name].std_error < 0.05


def test_noise_about_rest_is_no_way_back() -> None:
    speed = np.concatenate([np.zeros(1000), 2.0 * np.sin(np.pi * TIME[:3000] / 3.0) ** 2, np.zeros(3000)])
    position = np.cumsum(speed) * PERIOD_S + 1e-5 * np.random.default_rng(4).standard_normal(speed.size)
    model = fitted(position, torque_of(np.cumsum(speed) * PERIOD_S))
    assert not np.isfinite(model["coulomb"].std_error)


@pytest.mark.parametrize("correlated", [0.6, 0.8])
def test_a_window_is_as_long_as_correlated_noise_of_the_stamps_asks(correlated: float) -> None:
    """Rows are read up to 100 us (rms) off, some in turn alike: fast rows show less noise than the acceleration has."""
    rng, rows, period_s, turns = np.random.default_rng(3), 12_000, 1e-3, 2.0 * np.pi * 2.0
    late_s = lfilter([1.0], [1.0, -correlated], rng.standard_normal(rows))
    time_s = np.arange(rows) * period_s
    motor = 12.7 * np.sin(turns * (time_s + 1e-4 * late_s / late_s.std()))
    speed, bend = 12.7 * turns * np.cos(turns * time_s), -12.7 * turns**2 * np.sin(turns * time_s)
    torque = 1.9e-4 * bend + 1.7e-4 * speed + 0.08 * np.sign(speed) + 0.016 * rng.standard_normal(rows)
    found = fit_plain_model([motion_data(motor, torque, period_s)])
    assert found is not None
    assert found["inertia"].value == pytest.approx(1.9e-4, rel=0.01)  # by the noise of fast rows 3 % too small


def test_a_window_does_not_lengthen_for_a_fast_torque_that_moves_the_axis() -> None:
    """A longer window takes it from the acceleration, and from the torque."""
    rng, rows = np.random.default_rng(5), 12_000
    torque = lfilter([0.2], [1.0, -0.8], rng.standard_normal(rows))
    motor = np.cumsum(np.cumsum(torque - torque.mean()) * PERIOD_S / 1e-3) * PERIOD_S
    motor += 1e-5 * rng.standard_normal(rows)
    noise = position_noise(motor)[1]
    assert motion_data(motor, torque, PERIOD_S).window == quiet_window(motor, noise, PERIOD_S)
