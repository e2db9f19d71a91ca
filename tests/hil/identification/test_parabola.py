"""The parabola filter against that of scipy."""

import numpy as np
import pytest
from scipy.signal import savgol_coeffs, savgol_filter

from hil.identification.parabola import parabola_filter, parabola_weights


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
