"""The error of a weighted sum of noise counts how slowly the noise wanders."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.identification.spectrum import spectrum

ROWS, DRAWS = 4000, 300
ALL = np.ones(ROWS, dtype=bool)


def wandering(rng: np.random.Generator, pole: float) -> FloatArray:
    """White noise (n,) beside one of the autocorrelation pole^k, of which a row shows a third."""
    slow = lfilter([(1.0 - pole**2) ** 0.5], [1.0, -pole], rng.standard_normal(ROWS + 3000))[3000:]
    return np.asarray(slow + 1.5 * rng.standard_normal(ROWS), dtype=np.float64)


@pytest.mark.parametrize("pole", [0.0, 0.95, 0.995])
@pytest.mark.parametrize("swings", [20, 300])
def test_a_shape_that_is_not_there_is_as_seldom_as_its_level_says(pole: float, swings: int) -> None:
    rng, time, alarms = np.random.default_rng(3), np.arange(ROWS) / ROWS, 0
    for _ in range(DRAWS):
        shape = np.sin(2.0 * np.pi * (swings * time + rng.uniform()))
        basis, upper = np.linalg.qr(np.column_stack([shape, np.ones(ROWS), np.sign(np.sin(17.0 * time))]))
        weights, noise = np.linalg.pinv(upper) @ basis.T, wandering(rng, pole)
        left = noise - basis @ (basis.T @ noise)
        covariance, free = spectrum([left], [[one] for one in basis.T], [ALL]).covariance([[weights[0]]])
        ratio = abs(float(weights[0] @ noise)) / float(covariance[0, 0]) ** 0.5
        alarms += 2.0 * float(student.sf(ratio, free)) < 0.01
    assert alarms <= 10  # of 300 at 1 %: more in 1 of 1000 draws


@given(st.floats(1e-6, 1e6))
@settings(max_examples=20, deadline=None)
def test_the_error_has_the_unit_of_the_noise(unit: float) -> None:
    noise, weights = wandering(np.random.default_rng(4), 0.9), np.ones(ROWS) / ROWS
    (one, free), (other, same) = (spectrum([size * noise], [], [ALL]).covariance([[weights]]) for size in (1.0, unit))
    assert other[0, 0] == pytest.approx(unit**2 * one[0, 0], rel=1e-9)
    assert same == pytest.approx(free)


def test_white_noise_over_gaps_and_two_runs_has_the_error_of_its_rows() -> None:
    rng, rows = np.random.default_rng(5), np.arange(ROWS) % 5 > 1
    noise, weights = (np.where(rows, rng.standard_normal(ROWS), 0.0) for _ in range(2))
    parts = [noise, noise[: ROWS // 2]]
    covariance, free = spectrum(parts, [], [rows, rows[: ROWS // 2]]).covariance([[weights, weights[: ROWS // 2]]])
    energy = float(weights @ weights + weights[: ROWS // 2] @ weights[: ROWS // 2])
    assert covariance[0, 0] == pytest.approx(energy, rel=0.1)
    assert free > 200.0


def test_covariance_of_two_sums_is_symmetric_and_that_of_their_product() -> None:
    rng = np.random.default_rng(6)
    noise, one, other = (rng.standard_normal(ROWS) for _ in range(3))
    covariance, _ = spectrum([noise], [], [ALL]).covariance([[one], [one + 0.1 * other]])
    assert covariance[0, 1] == pytest.approx(covariance[1, 0], rel=1e-12)
    assert covariance[0, 1] == pytest.approx(float(one @ one), rel=0.1)


@pytest.mark.parametrize(("on", "off"), [(300, 100), (50, 50)])
def test_slow_noise_over_gaps_has_the_error_of_its_rows(on: int, off: int) -> None:
    rows = np.arange(6 * ROWS) % (on + off) < on
    shape = np.where(rows, np.sin(2.0 * np.pi * np.arange(rows.size) / 3000.0), 0.0)
    rng, sums, told = np.random.default_rng(7), list[float](), list[float]()
    for _ in range(60):
        slow = lfilter([0.2], [1.0, -0.98], rng.standard_normal(rows.size + 1000))[1000:]
        noise = np.where(rows, slow, 0.0)
        sums.append(float(shape @ noise))
        told.append(float(spectrum([noise], [], [rows]).covariance([[shape]])[0][0, 0]))
    assert np.mean(told) == pytest.approx(np.mean(np.square(sums)), rel=0.45)  # 60 draws know a variance to 18 %
    assert np.mean(told) > 0.7 * np.mean(np.square(sums))


def test_short_runs_have_each_band_once() -> None:
    runs = [np.random.default_rng(number).standard_normal(256) for number in range(20)]
    found = spectrum(runs, [], [np.ones(256, dtype=bool)] * 20)
    assert np.all(np.diff(found.first) > 0)
    assert found.covariance([runs])[1] <= found.rows
