"""Forgetting: the recordings stay those of the case, less of them is known."""

from __future__ import annotations

import numpy as np
import pytest

from hil.validation.proof.draw.generator import DrawnCase, draw
from hil.validation.proof.draw.less_known import COARSER, FEWER_ROWS, WAYS, WRONG_GAIN, forget, possible


@pytest.fixture(scope="module")
def case() -> DrawnCase:
    return draw("single", 3, 7, "stribeck_friction", "two_mass")


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_the_tier_forgets_something(case: DrawnCase) -> None:
    found = draw("less_known", 3, 7)
    assert found.truth.forgotten in WAYS
    assert found.truth.effects[0].effect in found.truth.not_testable
    assert found.truth.effects[0].size >= 5.0


@pytest.mark.parametrize("how", WAYS)
def test_the_given_recordings_and_bench_are_not_changed(case: DrawnCase, how: str) -> None:
    before = [dict(run.columns) for run in case.recordings]
    forget(how, case.recordings, case.bench, rng())
    for run, columns in zip(case.recordings, before, strict=True):
        assert all(run.columns[name] is columns[name] for name in columns)


def test_each_way_takes_away_what_it_says(case: DrawnCase) -> None:
    run, bench = case.recordings[0], case.bench
    law = bench.known_control
    assert not forget("no controller", case.recordings, bench, rng())[1].law_known
    assert "position_command_m" not in forget("no set-points", case.recordings, bench, rng())[0][0].columns
    wrong = forget("wrong gains", case.recordings, bench, rng())[1].known_control
    for name in law.gain_names:
        factor = getattr(wrong, name) / getattr(law, name)
        assert WRONG_GAIN[0] <= factor <= WRONG_GAIN[1]
    assert wrong.torque_limit_n_m == law.torque_limit_n_m
    fewer = forget("every fourth row", case.recordings, bench, rng())[0][0]
    assert fewer.period_s == FEWER_ROWS * run.period_s
    assert np.array_equal(fewer["motor_position_rad"], run["motor_position_rad"][::FEWER_ROWS])
    runs, alone = forget("one encoder", case.recordings, bench, rng())
    assert not alone.has_table_encoder
    assert "table_position_m" not in runs[0].columns
    coarse = forget("coarse positions", case.recordings, bench, rng())[0][0]
    error = coarse["motor_position_rad"] - run["motor_position_rad"]
    assert np.max(np.abs(error)) == pytest.approx(0.5 * COARSER * bench.motor_count, rel=0.02)


def test_an_axis_with_one_encoder_has_none_to_lose() -> None:
    linear = draw("single", 3, 7, axis="one_mass").draft.axis
    assert "one encoder" not in possible(linear)
    assert set(possible(linear)) == set(WAYS) - {"one encoder"}
