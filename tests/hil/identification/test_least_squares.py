"""Least squares at any scale, and standard errors that cover the error: seeded Monte Carlo and the textbook."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from hil.identification.least_squares import BLOCKS, Estimate, least_absolute, least_squares


@given(seed=st.integers(0, 10_000), scale=st.floats(1e-6, 1e6))
@settings(max_examples=50)
def test_the_normal_equations_are_solved_at_any_scale(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    scales = np.array([1.0, scale, 1.0])
    matrix, measured = rng.normal(size=(40, 3)) * scales, rng.normal(size=40)
    fit = least_squares(dict(zip("abc", matrix.T, strict=True)), measured, blocks=0)
    residual = measured - matrix @ fit.values
    assert np.abs(matrix.T @ residual / scales).max() < 1e-10
    np.testing.assert_allclose(fit.residual, residual)
    covariance = residual @ residual / 37 * np.linalg.inv(matrix.T @ matrix / np.outer(scales, scales))
    np.testing.assert_allclose(fit.std_errors * scales, np.sqrt(np.diag(covariance)), rtol=1e-8)
    assert fit.relative_error == pytest.approx(np.linalg.norm(residual) / np.linalg.norm(measured))
    assert fit.share == pytest.approx(1.0 - np.var(residual) / np.var(measured))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30)
def test_the_jackknife_is_that_of_fits_without_each_block(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(60, 3))
    measured = matrix @ [1.0, -2.0, 0.5] + lfilter([1.0], [1.0, -0.9], rng.normal(size=60))
    fit = least_squares(dict(zip("abc", matrix.T, strict=True)), measured)
    textbook = least_squares(dict(zip("abc", matrix.T, strict=True)), measured, blocks=0)
    size = 60 // BLOCKS
    kept = [np.r_[0:first, first + size : 60] for first in range(0, 60, size)]
    without = [np.linalg.lstsq(matrix[rows], measured[rows], rcond=None)[0] for rows in kept]
    jackknife = np.sqrt((BLOCKS - 1) * np.var(without, axis=0))
    np.testing.assert_allclose(fit.std_errors, np.maximum(jackknife, textbook.std_errors), rtol=1e-8)


def test_errors_cover_what_a_model_lacks_over_time() -> None:
    """A residual that wanders: the textbook formula is too small by a factor, the jackknife is not."""
    rng = np.random.default_rng(8)
    time = np.linspace(0.0, 1.0, 2000)
    columns = {"slope": np.sign(np.sin(40.0 * time)) + np.sin(9.0 * time), "one": np.ones_like(time)}
    clean = 2.0 * columns["slope"] + 1.0
    scores, textbook = [], []
    for _ in range(200):
        measured = clean + lfilter([0.3], [1.0, -0.98], rng.normal(size=time.size))
        for blocks, found in ((BLOCKS, scores), (0, textbook)):
            slope = least_squares(columns, measured, blocks=blocks)["slope"]
            found.append(abs(slope.value - 2.0) / slope.std_error)
    assert np.mean(np.array(scores) < 2.0) > 0.85
    assert np.mean(np.array(textbook) < 2.0) < 0.5


@given(seed=st.integers(0, 10_000), share=st.floats(0.2, 0.8))
@settings(max_examples=30)
def test_what_the_columns_do_not_tell_has_an_infinite_error(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 50))
    fit = least_squares({"a": a, "b": b, "both": share * b, "none": np.zeros(50)}, a + b)
    assert fit["a"].value == pytest.approx(1.0)
    assert fit["a"].std_error < 1e-10
    assert all(fit[name].std_error == np.inf for name in ("b", "both", "none"))
    assert not fit["b"].significant
    assert fit["b"].value + share * fit["both"].value == pytest.approx(1.0)
    assert fit.left < 1e-10


def test_too_few_rows_tell_no_error() -> None:
    fit = least_squares({"a": np.array([1.0, 2.0]), "one": np.ones(2)}, np.array([1.0, 5.0]), blocks=0)
    assert fit["a"].value == pytest.approx(4.0)
    assert np.all(np.isinf(fit.std_errors))


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.floats(-10.0, 10.0).filter(lambda factor: factor != 0.0))
def test_an_estimate_keeps_its_significance_in_another_unit(value: float, error: float, factor: float) -> None:
    scaled = Estimate(value, error, "so").scaled(factor)
    assert (scaled.value, scaled.std_error, scaled.how) == (factor * value, abs(factor) * error, "so")


def test_windows_of_another_level_do_not_shift_least_absolute_deviations() -> None:
    rows = np.linspace(-1.0, 1.0, 400)
    columns, weights = {"slope": rows, "one": np.ones_like(rows)}, np.ones_like(rows)
    measured = 3.0 * rows + 1.0
    window = np.abs(rows - 0.4) < 0.2
    shifted = np.where(window, measured + 50.0, measured)
    np.testing.assert_allclose(least_absolute(columns, shifted, weights), measured, atol=0.1)
    assert np.abs(least_squares(columns, shifted).residual[~window]).max() > 5.0
    weights[window] = 0.0
    np.testing.assert_allclose(least_absolute(columns, shifted, weights), measured, atol=1e-6)
