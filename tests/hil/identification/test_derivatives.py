"""Derivatives by parabolas: exact on parabolas, with the noise gain that they claim, for any number of rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.identification.derivatives import motion, rows_per_sample, smoothed, window_rows

PERIODS = st.floats(1e-4, 0.5)


@given(PERIODS, st.tuples(*[st.floats(-10.0, 10.0)] * 3), st.integers(6, 400))
def test_the_motion_of_a_parabola_is_exact(period_s: float, abc: tuple[float, float, float], rows: int) -> None:
    a, b, c = abc
    time = np.arange(rows) * period_s
    moved = motion(a + b * time + c * time**2, period_s)
    size = 1e-8 * (1.0 + abs(a) + abs(b) + abs(c)) * max(time[-1], 1.0) ** 2
    np.testing.assert_allclose(moved.position, a + b * time + c * time**2, atol=size)
    np.testing.assert_allclose(moved.velocity, b + 2.0 * c * time, atol=size / period_s)
    np.testing.assert_allclose(moved.acceleration, 2.0 * c, atol=size / period_s**2)


@given(PERIODS)
def test_white_noise_keeps_the_variance_of_its_independent_samples(period_s: float) -> None:
    window = window_rows(period_s)
    assert window % 2 == 1
    impulse = np.zeros(4 * window + 1)
    impulse[2 * window] = 1.0
    assert np.sum(smoothed(impulse, period_s) ** 2) == pytest.approx(1.0 / rows_per_sample(period_s))


def test_there_is_no_direction_at_rest() -> None:
    time = np.linspace(0.0, 2.0, 2001)
    moved = motion(np.sin(np.pi * time), 1e-3)
    slides = np.abs(moved.velocity) > 0.01 * np.abs(moved.velocity).max()
    np.testing.assert_array_equal(moved.direction, np.where(slides, np.sign(moved.velocity), 0.0))
    assert 0 < np.count_nonzero(~slides) < 100


@given(st.integers(0, 7))
def test_a_few_rows_have_a_motion_too(rows: int) -> None:
    moved = motion(np.arange(rows) * 2.0, 0.001)
    assert moved.velocity.shape == moved.direction.shape == (rows,)
    if rows > 2:
        np.testing.assert_allclose(moved.velocity, 2000.0)
