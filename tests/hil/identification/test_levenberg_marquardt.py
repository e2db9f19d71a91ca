"""The damped step between bounds, against scipy's bounded least squares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from hil.identification.levenberg_marquardt import damped_step, normal_equations


@given(size=st.integers(1, 40), seed=st.integers(0, 10_000), width=st.floats(1e-3, 10.0))
def test_the_damped_step_is_the_least_squares_solution_between_its_bounds(size: int, seed: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    slopes = rng.normal(size=(size + 5, size)) * 10.0 ** rng.uniform(-3.0, 3.0, size)
    residuals = 3.0 * rng.normal(size=size + 5)
    normal, descent = normal_equations(slopes, residuals, None)
    scale = np.sqrt(np.diag(normal))
    low, high = -width * rng.uniform(0.0, 1.0, size) / scale, width * rng.uniform(0.1, 1.0, size) / scale
    step = damped_step(normal, descent, 1e-3, scale, low, high)
    assert (step >= low).all()
    assert (step <= high).all()

    def cost(at: np.ndarray) -> float:
        return float(np.sum((slopes @ at + residuals) ** 2) + 1e-3 * np.sum((scale * at) ** 2))

    both = np.concatenate([slopes / scale, np.sqrt(1e-3) * np.eye(size)])
    target = np.concatenate([-residuals, np.zeros(size)])
    expected = lsq_linear(both, target, (low * scale - 1e-12, high * scale), method="bvls").x / scale
    assert cost(step) <= cost(expected) * (1.0 + 1e-9)


def test_normal_equations_by_blocks_are_those_of_the_whole() -> None:
    rng = np.random.default_rng(1)
    rows = 70_000  # more than two blocks
    slopes, residuals, weights = rng.normal(size=(rows, 3)), rng.normal(size=rows), rng.uniform(0.1, 1.0, rows)
    for own in (None, weights):
        weighted = slopes if own is None else slopes * own[:, None]
        normal, descent = normal_equations(slopes, residuals, own)
        assert normal == pytest.approx(weighted.T @ weighted)
        assert descent == pytest.approx(weighted.T @ (residuals if own is None else residuals * own))
