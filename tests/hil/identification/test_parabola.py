"""Parabolas: the filter against that of scipy, and the step by which the first rows begin."""

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from hil.identification.parabola import first_step, parabola_filter, parabola_weights


@pytest.mark.parametrize("rows", [3, 5, 21, 351])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_it_is_the_filter_of_scipy(rows: int, derivative: int) -> None:
    values = np.cumsum(np.random.default_rng(1).normal(size=400))
    ours = parabola_filter(values, rows, derivative, 1e-3)
    theirs = savgol_filter(values, rows, 2, deriv=derivative, delta=1e-3)
    assert np.max(np.abs(ours - theirs)) <= 1e-11 * np.max(np.abs(theirs))
    half = rows // 2
    assert np.array_equal(ours[half:-half], theirs[half:-half])
    assert np.array_equal(parabola_weights(rows, derivative), savgol_coeffs(rows, 2, deriv=derivative))


@pytest.mark.parametrize("rest", [1, 4, 8, 20])
def test_an_axis_that_starts_within_the_first_rows_rests_at_first(rest: int) -> None:
    count = 6e-6
    moved = np.concatenate([np.zeros(rest), 1e-3 * np.arange(1, 21) ** 2])[:11]
    assert abs(first_step(np.round(moved / count) * count, count / np.sqrt(12.0))) < (2e-3 if rest == 1 else count)


def test_the_first_step_of_a_motion_is_that_of_its_parabola() -> None:
    random, at = np.random.default_rng(3), np.arange(11)
    steady = 0.02 * at + 1e-4 * at**2 + random.normal(0.0, 1e-5, 11)
    assert first_step(steady, 1e-5) == pytest.approx(0.02 - 1e-4, abs=2e-5)
    creeping = np.round(0.3 * at)  # coarse counts
    assert first_step(creeping, 1.0 / np.sqrt(12.0)) == pytest.approx(0.3, abs=0.15)
    assert first_step(np.zeros(11), 0.0) == 0.0
