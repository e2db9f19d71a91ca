"""The plain model: exact on exact motion, in any unit, for either direction of the axis, with errors that cover."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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


def fitted(position: FloatArray, torque: FloatArray, load_ratio: float | None = None) -> PlainModel:
    found = fit_plain_model([motion_data(position, torque, PERIOD_S)], load_ratio, spring=True)
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
    for _ in range(60):
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
    assert not data.sliding(model.slowest)[np.abs(data.moved.velocity) <= model.slowest].any()


@pytest.mark.parametrize("position", [np.zeros(4000), TURN[:60]])
def test_rest_and_a_few_rows_tell_nothing(position: FloatArray) -> None:
    assert fit_plain_model([motion_data(position, np.ones(position.size), PERIOD_S)]) is None


def test_the_structure_is_earned() -> None:
    """Two more parameters are not kept for what they explain by chance."""
    rng = np.random.default_rng(2)
    moved = motion(TURN, PERIOD_S)
    columns = {name: column[::100] for name, column in plain_columns(moved, 1.5, spring=True).items()}
    torque = torque_of(TURN)[::100]
    kept = [least_structure(columns, torque + rng.normal(size=torque.size), 60, 3.0).names for _ in range(100)]
    assert kept.count(MOTION) >= 99
