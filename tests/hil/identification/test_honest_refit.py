"""A refit is in no channel worse than the bench file; the torque left is compared with a plain model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, fitted, moves, recorded

from hil.bench.control_section import UnknownControl
from hil.identification.dataset import Dataset
from hil.identification.honest_refit import holds, never_worse, rms_at_floor, rms_of_channels
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal
from hil.identification.terms import Term
from hil.identification.torque_left import (
    fit_plain,
    left_by_plain,
    left_by_twin,
    measured_motion,
    needed_torque,
    torque_deviation,
)

HEAVY = 1.3 * 384.0


@pytest.fixture(scope="module")
def data() -> Dataset:
    owner = bench(table_mass_kg=HEAVY)
    return dataset([take(recorded(bench()), owner)], owner)


def test_a_fit_that_is_better_everywhere_is_kept(data: Dataset) -> None:
    found = fitted(Hypothesis(data.bench), data)
    refit = never_worse(found, partial(rms_of_channels, data=data), rms_at_floor(data))
    assert refit.fit is found
    assert refit.note == ""


def test_a_fit_that_sacrifices_a_channel_is_shortened_or_left(data: Dataset) -> None:
    """A point with twice the Coulomb friction: the torque of the closed loop is worse."""
    found = evaluated(Hypothesis(data.bench), data)
    names = [coordinate.name for coordinate in found.hypothesis.coordinates]
    x = found.hypothesis.x.copy()
    x[names.index("coulomb_torque_n_m")] = np.log(2.0)
    wrong = evaluated(found.hypothesis.moved(x), data)
    figures = partial(rms_of_channels, data=data)
    refit = never_worse(wrong, figures, rms_at_floor(data))
    assert "worse than the bench file" in refit.note
    assert "torque (in closed loop)" in refit.note
    before, after = figures(wrong.hypothesis.given), figures(refit.fit.hypothesis)
    assert all(after[name] <= 1.01 * max(before[name], rms_at_floor(data)[name]) for name in before)


@pytest.mark.parametrize("law", [4.0, 1.0])
def test_the_fit_of_the_command_line_is_never_worse(law: float) -> None:
    """Also beside a velocity gain that is wrong by a factor of four."""
    owner = bench(table_mass_kg=HEAVY)
    gain = law * (owner.known_control.velocity_gain_ma_rpm or 0.0)
    owner = owner.model_copy(update={"control": owner.control.model_copy(update={"velocity_gain_ma_rpm": gain})})
    given = dataset([take(recorded(bench()), owner)], owner)
    result = fit_nominal(given)
    before, after = (rms_of_channels(Hypothesis(one), given) for one in (owner, result.bench))
    floors = rms_at_floor(given)
    assert all(after[name] <= max(1.01 * before[name], floors[name]) for name in before)
    assert bool(result.note) == (law != 1.0)


def test_a_loop_that_swings_between_its_limits_is_not_held(data: Dataset) -> None:
    assert holds(Hypothesis(bench()), data)
    light = bench(motor_mass_kg=2.0, table_mass_kg=2.0)
    assert not holds(Hypothesis(light), data)


def test_the_torque_left_is_compared_with_a_plain_model() -> None:
    """Of a cogging axis the plain model leaves the cogging, the true twin the noise."""
    owner = bench(table_mass_kg=HEAVY)
    cogging = Term("cogging_torque", 0, (0.1, 6.0, 0.2))
    train, held_out = (dataset([take(recorded(bench(), cogging, seed=seed), owner)], owner) for seed in (1, 2))
    plain = fit_plain(train)
    assert plain is not None
    inertia = 719.0 * owner.axis.ratio_m_rad**2
    assert plain["inertia"].value == pytest.approx(inertia, rel=0.05)
    by_plain = left_by_plain(plain, held_out)
    deviation = torque_deviation([held_out], plain.slowest)
    assert left_by_plain(plain, held_out, 2.0 * deviation) == pytest.approx(0.5 * (by_plain or 0.0))
    assert min(deviation, torque_deviation([train], plain.slowest)) <= torque_deviation(
        (train, held_out), plain.slowest
    )
    by_owner, by_truth = (
        left_by_twin(hypothesis, held_out, plain) for hypothesis in (Hypothesis(owner), Hypothesis(bench(), (cogging,)))
    )
    assert by_plain is not None
    assert by_owner is not None
    assert by_truth is not None
    assert by_truth < 0.2 * by_plain
    # 115 kg too much: a sixth of the inertia
    assert by_owner > by_plain


def test_the_plain_model_leaves_what_plain_least_squares_leave() -> None:
    """By own derivatives, means over 21 ms, on the rows whose means reach no reversal and no rest."""
    owner = bench()
    run = take(recorded(bench(), Term("cogging_torque", 0, (0.1, 1.0, 0.2))), owner)
    data = dataset([run], owner)
    plain = fit_plain(data)
    assert plain is not None
    kernel = np.ones(21) / 21.0
    velocity = np.gradient(run.motor, run.period_s)
    means = [np.convolve(one, kernel, "same") for one in (np.gradient(velocity, run.period_s), velocity, run.torque)]
    rows = np.zeros(run.motor.size, dtype=bool)
    for at in range(run.evaluated.start + 40, run.motor.size - 40):
        near = velocity[at - 20 : at + 21] / np.abs(velocity).max()
        rows[at] = near.min() > 0.02 or near.max() < -0.02
    a, v, torque = (one[rows] for one in means)
    matrix = np.column_stack([a, v, np.sign(v), np.ones(a.size)])
    left = torque - matrix @ np.linalg.lstsq(matrix, torque, rcond=None)[0]
    assert left_by_plain(plain, data) == pytest.approx(np.std(left) / np.std(torque), rel=0.15)


def test_a_twin_that_the_torque_does_not_move_has_no_torque_left(data: Dataset) -> None:
    plain = fit_plain(data)
    assert plain is not None
    idle = Term("torque_dead_zone", 1, (100.0,))
    assert left_by_twin(Hypothesis(data.bench, (idle,)), data, plain) is None


def test_the_torque_left_is_that_of_the_undelayed_torque() -> None:
    """The known delay of a recorded torque is undone before the twin gets it."""
    unknown = UnknownControl(law="unknown", velocity_period_s=1e-3)
    now, late = (
        bench().model_copy(update={"control": unknown.model_copy(update={"torque_delay_s": delay_s})})
        for delay_s in (0.0, 6e-3)
    )
    data = dataset([take(recorded(bench()), now)], now)
    early = data.over([replace(data.runs[0], torque=np.roll(data.runs[0].torque, -6))])
    plain = fit_plain(data)
    assert plain is not None
    by_now, by_late = (left_by_twin(Hypothesis(one), early, plain) for one in (now, late))
    assert by_now is not None
    assert by_late is not None
    assert by_late < 0.5 * by_now


def test_friction_that_a_bench_leaves_out_is_fitted() -> None:
    """A draft says 0 where another effect hides the friction; 0 is no bound of it."""
    owner = bench(coulomb_torque_n_m=0.0, viscous_torque_n_m_s_rad=0.0)
    found = fit_nominal(dataset([take(recorded(bench()), owner)], owner), lambda one: {})
    assert found.bench.axis.coulomb_torque_n_m == pytest.approx(bench().axis.coulomb_torque_n_m, rel=0.01)  # type: ignore[union-attr]
    assert found.bench.axis.viscous_torque_n_m_s_rad == pytest.approx(bench().axis.viscous_torque_n_m_s_rad, rel=0.03)  # type: ignore[union-attr]


def test_the_noise_of_the_torque_does_not_stop_a_twin_that_creeps() -> None:
    """Less torque by its noise stops a twin at creep; what it then lacks would be friction that is not there."""
    owner = bench().model_copy(update={"control": UnknownControl(law="unknown", velocity_period_s=1e-3)})
    there = [{"kind": "sine_squared", "to_m": to, "feed_m_s": v} for to, v in ((0.004, 0.02), (0.0, 0.02))]
    slow = [{"kind": "sine_squared", "to_m": to, "feed_m_s": 0.001} for to in (0.001, 0.0)]
    recording = recorded(bench(), profile=moves([*there, *slow]), torque_noise_n_m=1.0)
    run = take(recording, owner)
    data = dataset([run], owner)
    plain = fit_plain(data)
    assert plain is not None
    needed, motion = needed_torque(Hypothesis(owner), data, plain)[0], measured_motion(run)
    creeps = needed.rows & (np.abs(motion.moved.velocity) < 0.8)
    assert np.count_nonzero(creeps) > 1000
    along = float(np.mean((needed.left * motion.moved.direction)[creeps]))
    assert abs(along) < 0.06  # by one torque for all rows it lacks -0.2 N m
