"""Means of the residual of a law, and their errors."""

import numpy as np
import pytest
from diagnosis_runs import bench

from hil.diagnosis.pictures.fitted_law import FittedRows, bin_edges, law_at, means
from hil.identification.terms import Term

SIZE = 20_000


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_errors_of_means_are_those_of_noise_with_memory_that_grows_with_the_carrier(memory: float) -> None:
    """Chi-square per bin of many draws, with a carrier that changes its sign."""
    draw, found = np.random.default_rng(3), []
    x = 50.0 * np.sin(np.linspace(0.0, 12.0, SIZE))
    carrier = np.sign(np.gradient(x)) * (1.0 + 0.01 * np.abs(x))
    for _ in range(10):
        noise = draw.normal(size=SIZE)
        for row in range(1, SIZE):
            noise[row] += memory * noise[row - 1]
        rows = [FittedRows(x, carrier, 0.3 * carrier + noise, noise, np.ones(SIZE, dtype=bool))]
        one = means(rows, bin_edges(rows, 30))
        found.append(np.mean((one.after / one.error) ** 2))
        assert np.mean(np.abs(one.before - one.after - 0.3)) < 1e-9
    assert 0.7 < np.mean(found) < 1.4


def test_a_bin_with_few_rows_has_no_point() -> None:
    x = np.concatenate([np.zeros(100), [9.5, 9.6]])
    rows = [FittedRows(x, np.ones(102), x, np.random.default_rng(1).normal(size=102), np.ones(102, dtype=bool))]
    assert means(rows, np.linspace(0.0, 10.0, 11)).x.size == 1


def test_a_law_is_the_contribution_of_its_mechanism() -> None:
    angle = np.linspace(0.0, 1.0, 5)
    law = law_at(Term("cogging_torque", 0, (0.2, 12.0, 0.3)), bench(), angle_rad=angle)
    assert law == pytest.approx(0.2 * np.sin(12.0 * angle + 0.3))
    level = law_at(Term("stribeck_friction", 0, (1.5, 2.0)), bench(), 1.0, velocity=np.array([0.0, 2.0]))
    assert level == pytest.approx([1.5, 1.0 + 0.5 * np.exp(-1.0)])
