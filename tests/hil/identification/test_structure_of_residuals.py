"""Structure of a residual: noise, however slow, has none; a dependence is found with its size."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.identification.structure import ResidualSeries, autocovariance, structure

ROWS = 6000


def series(left: FloatArray) -> list[ResidualSeries]:
    return [ResidualSeries(left, np.ones(left.size, dtype=bool))]


def slow_noise(seed: int, pole: float) -> FloatArray:
    """Noise (n,) of variance 1 with the autocorrelation pole^k."""
    white = np.random.default_rng(seed).standard_normal(ROWS + 500)
    return np.asarray(lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[500:])


def swing() -> FloatArray:
    """A quantity (n,) that passes its range forth and back, with drifting phase."""
    return np.sin(2.0 * np.pi * np.arange(ROWS) / 731.0)


@pytest.mark.parametrize("pole", [0.0, 0.8, 0.97])
def test_noise_is_called_structure_as_seldom_as_its_level_says(pole: float) -> None:
    alarms = 0
    for seed in range(200):
        found = structure(series(slow_noise(seed, pole)), [swing()])
        assert found is not None
        alarms += found.p < 0.01
    assert alarms <= 8  # of 200 at 1 %: more in 1 of 1000 draws


@pytest.mark.parametrize(("pole", "size"), [(0.0, 0.2), (0.9, 0.6)])
def test_a_bend_below_the_noise_is_found(pole: float, size: float) -> None:
    x = swing()
    bend = size * (3.0 * x**2 - 1.0)
    found = structure(series(slow_noise(1, pole) + bend), [x])
    assert found is not None
    assert found.p < 1e-3
    assert found.energy == pytest.approx(np.var(bend), rel=0.4)


def plateaus(seed: int) -> tuple[FloatArray, FloatArray]:
    """A quantity (n,) of random levels for 150 rows each, and the noise of a loop that is in it and in the residual."""
    random = np.random.default_rng(seed)
    levels = np.repeat(random.choice([-2.0, -0.95, 1.0, 1.7, 2.4], ROWS // 150), 150)
    return levels, slow_noise(seed + 1000, 0.9)


def test_noise_of_the_quantity_within_a_plateau_is_no_structure() -> None:
    alarms = 0
    for seed in range(60):
        levels, loop = plateaus(seed)
        found = structure(series(slow_noise(seed, 0.97) + loop), [levels + 0.03 * loop])
        alarms += found is not None and found.p < 0.01
    assert alarms <= 4  # of 60 at 1 %: more in 1 of 2000 draws; 49 with edges in the plateaus


@pytest.mark.parametrize("one_of", [2, 3, 7])
@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_two_levels_have_an_edge_between_them(one_of: int, noise: float) -> None:
    levels = np.repeat(np.where(np.arange(ROWS // 150) % one_of == 0, -1.0, 1.0), 150)
    found = structure(series(levels + slow_noise(4, 0.9)), [levels + noise * slow_noise(5, 0.9)])
    assert found is not None
    assert found.p < 1e-3


def test_levels_that_differ_are_structure() -> None:
    levels, loop = plateaus(3)
    found = structure(series(0.5 * (levels > 1.5) + slow_noise(3, 0.9) + loop), [levels + 0.03 * loop])
    assert found is not None
    assert found.p < 1e-3


def test_the_map_predicts_other_rows() -> None:
    x = swing()
    found = structure(series(np.sign(x) + 0.1 * slow_noise(2, 0.5)), [x])
    assert found is not None
    assert found.at(np.array([-0.9, 0.9])) == pytest.approx([-1.0, 1.0], abs=0.05)


def test_rows_that_do_not_count_and_several_parts_are_no_matter() -> None:
    x, left = swing(), slow_noise(3, 0.5)
    rows = np.arange(ROWS) % 3 > 0
    spoilt = np.where(rows, left, 1e9)
    found = structure([ResidualSeries(spoilt, rows), ResidualSeries(left, rows)], [x, x])
    assert found is not None
    assert np.abs(found.means).max() < 1.0


@given(st.floats(1e-9, 1e9))
@settings(max_examples=20, deadline=None)
def test_chance_does_not_depend_on_units(unit: float) -> None:
    x, left = swing(), slow_noise(4, 0.5)
    one, other = structure(series(left), [x]), structure(series(unit * left), [1024.0 * x])
    assert one is not None
    assert other is not None
    assert other.p == pytest.approx(one.p, rel=1e-3)


@pytest.mark.parametrize("left", [np.zeros(ROWS), np.full(ROWS, 3.0)])
def test_nothing_is_told_of_a_residual_without_noise(left: FloatArray) -> None:
    assert structure(series(left), [swing()]) is None


def test_few_rows_and_a_constant_quantity_tell_nothing() -> None:
    assert structure(series(slow_noise(5, 0.0)[:9]), [swing()[:9]]) is None
    assert structure(series(slow_noise(5, 0.0)), [np.ones(ROWS)]) is None
    assert structure(series(slow_noise(5, 0.0)), [np.full(ROWS, np.nan)]) is None


def test_autocovariance_is_that_of_the_noise() -> None:
    found = autocovariance(series(slow_noise(6, 0.9)))
    assert found[0] == pytest.approx(1.0, rel=0.2)
    assert found[5] / found[0] == pytest.approx(0.9**5, abs=0.15)


def test_weak_slow_noise_is_no_structure_over_time_and_a_step_is() -> None:
    rng, n = np.random.default_rng(5), 20_000
    time, rows = np.arange(n) * 1e-3, np.ones(n, dtype=bool)
    drift = np.repeat(rng.normal(0.0, 0.3, n // 200), 200)  # a tenth of the white variance, over a fifth of a bin
    noise = rng.normal(0.0, 1.0, n) + drift
    for step, told in ((0.0, False), (0.5, True)):
        found = structure([ResidualSeries(noise + step * (time > 10.0), rows)], [time])
        assert found is not None
        assert (found.p < CRITERIA.significance / 14) == told  # of as many questions
