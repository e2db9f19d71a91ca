"""Coefficients of least squares whose errors are correlated, and the chance of their ratios."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lfilter
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.identification.coefficient import coefficients, log_tail
from hil.identification.laps import Laps


@pytest.mark.parametrize("free", [3.0, 40.0, 3e3, 1e5])
@pytest.mark.parametrize("ratio", [0.0, 2.0, 30.0, 90.0, 1e3])
def test_the_tail_of_students_t_is_told_where_it_is_no_floating_point_number(ratio: float, free: float) -> None:
    """Two shapes whose chances are both 0.0 as numbers can be ordered by their logarithms."""

    def over_density(way: float) -> float:
        return math.exp(student.logpdf(ratio + way, free) - student.logpdf(ratio, free))

    width = 1.0 / max(1.0, ratio * (free + 1.0) / (free + ratio**2))
    area = width * quad(lambda way: over_density(width * way), 0.0, math.inf, limit=400)[0]
    assert log_tail(ratio, free) == pytest.approx(student.logpdf(ratio, free) + math.log(area), abs=0.02)


def test_noise_that_repeats_from_lap_to_lap_tells_no_more_than_one_lap() -> None:
    rng, lap, rows = np.random.default_rng(5), 1200, np.ones(2400, dtype=bool)
    laps = Laps(np.arange(lap), np.arange(lap) + lap)
    shape = np.tile(np.sin(0.05 * np.arange(lap)), 2)
    matrix = np.column_stack([shape, np.ones(2 * lap)])

    def told(signal: FloatArray, of: Laps | None) -> float:
        return coefficients(matrix, signal, [rows], [of], 1)[0].ratio

    ratios = {"repeats": list[float](), "not told": list[float](), "does not": list[float]()}
    for _ in range(120):
        same, other = np.tile(rng.standard_normal(lap), 2), rng.standard_normal(2 * lap)
        ratios["repeats"].append(told(same, laps))
        ratios["not told"].append(told(same, None))
        ratios["does not"].append(told(other, laps))
    spread = {name: float(np.std(values)) for name, values in ratios.items()}
    assert spread["repeats"] == pytest.approx(1.0, abs=0.15)
    assert spread["does not"] == pytest.approx(1.0, abs=0.15)
    assert spread["not told"] > 1.25  # what the error would be wrong by


def test_two_coefficients_are_told_beside_each_other_and_a_slow_error() -> None:
    rng, time = np.random.default_rng(7), np.arange(3000)
    sine, cosine = np.sin(0.9 * time), np.cos(0.9 * time)
    slow = lfilter([1.0], [1.0, -0.99], rng.standard_normal(time.size))
    rows = rng.random(time.size) > 0.1
    matrix = np.column_stack([sine, cosine, np.ones(time.size)])[rows]
    found = coefficients(matrix, (0.3 * sine - 0.2 * cosine + slow)[rows], [rows], [None], 2)
    assert [one.value for one in found] == pytest.approx([0.3, -0.2], abs=0.1)
    assert all(one.free > 50.0 for one in found)
    assert max(abs(found[0].value - 0.3), abs(found[1].value + 0.2)) < 4.0 * 0.3 / found[0].ratio


def test_a_column_that_the_others_make_is_not_told() -> None:
    time = np.arange(500.0)
    matrix = np.column_stack([2.0 * np.sin(time), np.sin(time)])
    assert coefficients(matrix, np.cos(time), [np.ones(500, dtype=bool)], [None], 1) == [(0.0, 0.0, 0.0)]
