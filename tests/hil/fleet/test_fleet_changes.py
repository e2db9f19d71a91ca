"""Change points: places and sizes of known changes within their errors, and how seldom there are false ones."""

from __future__ import annotations

import numpy as np
import pytest

from hil.fleet.changes import FEWEST, LOOKS, history, threshold_of
from hil.fleet.segment_costs import SegmentCosts, partial_correlations

QUANTITIES = 14


def looked_at(values: np.ndarray, errors: float = 0.3) -> object:
    found = history(np.arange(values.size) * 7.0, values, np.full(values.size, errors), QUANTITIES)
    assert found is not None
    return found


def test_a_step_has_its_place_and_size() -> None:
    rng, inside, off = np.random.default_rng(1), 0, []
    for _ in range(30):
        at = int(rng.integers(20, 80))
        values = rng.standard_normal(104) + 3.0 * (np.arange(104) >= at)
        (change,) = looked_at(values).changes  # type: ignore[attr-defined]
        day = 7.0 * (at - 0.5)
        inside += change.earliest <= day <= change.latest
        off.append((change.step - 3.0) / change.step_error)
        assert change.kind == "step"
    assert inside >= 28  # 95 %
    assert np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_slope_begins_and_ends_at_a_service() -> None:
    at = np.arange(120)
    wear = np.where((at >= 30) & (at < 90), 0.25 * (at - 30.0), 0.0)
    found = looked_at(wear + np.random.default_rng(2).standard_normal(120))
    begun, serviced = found.changes  # type: ignore[attr-defined]
    assert (begun.kind, serviced.kind) == ("slope", "step")
    assert begun.earliest <= 7.0 * 30 <= begun.latest
    assert begun.slope == pytest.approx(0.25 / 7.0, abs=4.0 * begun.slope_error)
    assert serviced.earliest <= 7.0 * 89.5 <= serviced.latest
    assert found.now.slope == 0.0  # type: ignore[attr-defined]


def correlated(rng: np.random.Generator, count: int, by: float) -> np.ndarray:
    values = rng.standard_normal(count)
    for at in range(1, count):
        values[at] = by * values[at - 1] + np.sqrt(1.0 - by**2) * values[at]
    return values


@pytest.mark.parametrize("kind", ["white", "correlated", "outliers", "both"])
def test_what_only_scatters_has_no_change(kind: str) -> None:
    """In 60 series at most what the bound allows of one quantity in as many years: 60 / 14."""
    rng, false = np.random.default_rng(3), 0
    for _ in range(60):
        values = correlated(rng, 90, 0.8 if kind in ("correlated", "both") else 0.0)
        if kind in ("outliers", "both"):
            values += 8.0 * rng.standard_normal(90) * (rng.uniform(size=90) < 0.03)
        found = looked_at(values)
        false += bool(found.changes or found.now.slope)  # type: ignore[attr-defined]
    assert false <= 60 / QUANTITIES


def test_a_step_among_outliers_of_a_correlated_quantity_is_found() -> None:
    rng = np.random.default_rng(5)
    values = correlated(rng, 80, 0.5) + 6.0 * (np.arange(80) >= 50)
    values[[7, 30, 31, 32, 66, 79]] += [40.0, -9.0, -9.0, -9.0, 25.0, -30.0]
    (change,) = looked_at(values).changes  # type: ignore[attr-defined]
    assert change.kind == "step"
    assert change.earliest <= 7.0 * 49.5 <= change.latest
    assert change.step == pytest.approx(6.0, abs=3.0 * change.step_error)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_level_has_four_recordings_at_least(count: int) -> None:
    """Fewer at another level are no change, how far they may be: at the end, and in the middle."""
    values = np.random.default_rng(6).standard_normal(60)
    for at in (60 - count, 30):
        other = values.copy()
        other[at : at + count] += 50.0
        assert bool(looked_at(other).changes) == (count >= 4)  # type: ignore[attr-defined]


def test_a_cost_is_the_likelihood_of_correlated_noise() -> None:
    """Against the dense covariance of an autoregression of order 2, with unequal scales: a line fitted by it."""
    from scipy.linalg import toeplitz

    rng, partial = np.random.default_rng(7), (0.6, 0.3)
    first, second = partial[0] * (1.0 - partial[1]), partial[1]
    day, scales = np.cumsum(rng.uniform(0.5, 2.0, 30)), rng.uniform(0.5, 2.0, 30)
    values = rng.standard_normal(30) + 0.1 * day
    costs = SegmentCosts(day, values, scales, partial)
    correlations = [1.0, partial[0]]
    for _ in range(28):
        correlations.append(first * correlations[-1] + second * correlations[-2])
    power = 1.0 / ((1.0 - partial[0] ** 2) * (1.0 - partial[1] ** 2))  # of a row, for innovations of 1
    for begin, end in ((0, 30), (5, 12), (26, 30)):
        noise = power * toeplitz(correlations[: end - begin])
        covariance = noise * np.outer(scales[begin:end], scales[begin:end])
        weight = np.linalg.inv(covariance)
        for terms, cost in zip((1, 2), costs.of(begin, end), strict=True):
            columns = np.array([np.ones(end - begin), day[begin:end]])[:terms].T
            fit = np.linalg.solve(columns.T @ weight @ columns, columns.T @ weight @ values[begin:end])
            left = values[begin:end] - columns @ fit
            assert float(cost) == pytest.approx(float(left @ weight @ left))
            assert costs.left(begin, end, terms == 2) == pytest.approx(left / scales[begin:end])
        assert costs.added == pytest.approx(np.linalg.slogdet(noise)[1])


def test_correlations_are_those_of_the_noise() -> None:
    rng = np.random.default_rng(8)
    parts = [correlated(rng, 300, 0.6) for _ in range(4)]
    assert partial_correlations(parts, 2) == pytest.approx((0.6, 0.0), abs=0.06)
    assert partial_correlations([correlated(rng, 300, 0.97)], 1) == (0.8,)  # more is a wander


def test_the_threshold_rises_with_what_is_looked_at() -> None:
    """The chance of a gain falls as that of chi^2 with two degrees of freedom: exp(-threshold / 2)."""
    assert np.exp(0.5 * (threshold_of(QUANTITIES) - threshold_of(1))) == pytest.approx(QUANTITIES)
    assert np.exp(-0.5 * threshold_of(QUANTITIES)) < 1.0 / (LOOKS * QUANTITIES)


def test_too_few_recordings_tell_nothing() -> None:
    assert history(np.arange(FEWEST - 1.0), np.zeros(FEWEST - 1), np.ones(FEWEST - 1)) is None


def test_values_without_any_scatter_have_no_change() -> None:
    found = looked_at(np.full(40, 2.0), 0.0)
    assert (found.changes, found.now.begin) == ((), 2.0)  # type: ignore[attr-defined]
