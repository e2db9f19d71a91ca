"""One search for periods: the strongest line over uneven positions, and the share that it explains."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lombscargle

from hil.identification.periods import harmonic_share, refined_period, strongest_periods


@given(st.floats(0.011, 0.2), st.floats(-3.0, 3.0), st.floats(-5.0, 5.0), st.integers(0, 1000))
@settings(max_examples=30)
def test_the_period_of_a_wave_is_found_over_uneven_positions(
    period: float, phase: float, level: float, seed: int
) -> None:
    x = np.sort(np.random.default_rng(seed).uniform(0.0, 1.0, 4000))
    found = strongest_periods(x, np.sin(2.0 * np.pi * x / period + phase) + level, 1e-3, 0.01, 1)
    assert 1.0 / found[0] == pytest.approx(1.0 / period, abs=0.3)  # of 1 / span


def test_lines_come_by_strength_within_the_limits() -> None:
    x = np.linspace(0.0, 1.0, 5000)
    signal = np.sin(2.0 * np.pi * x / 0.02) + 3.0 * np.sin(2.0 * np.pi * x / 0.1) + 9.0 * np.sin(2.0 * np.pi * x / 0.5)
    assert strongest_periods(x, signal, 1e-3, 0.01, 3) == pytest.approx([0.5, 0.1, 0.02], rel=0.03)
    assert strongest_periods(x, signal, 1e-3, 0.05, 1, 0.3) == pytest.approx([0.1], rel=0.03)


@pytest.mark.parametrize(("span", "turns", "trend"), [(1.0, 7.3, 0.0), (1e5, 41.13, 0.0), (1.0, 5.3, 3.0)])
def test_a_period_is_refined_by_the_rows(span: float, turns: float, trend: float) -> None:
    """Beside what varies slowly, and over a million radians as well."""
    x = np.linspace(0.0, span, 20_000)
    signal = np.sin(2.0 * np.pi * turns * x / span) + trend * (x / span) ** 2
    signal += np.random.default_rng(1).normal(0.0, 0.3, x.size)
    (rough,) = strongest_periods(x, signal, span / 2000, span / 500, 1, 0.4 * span)
    refined = refined_period(x, signal, rough, span / 500, 0.4 * span)
    assert abs(span / refined - turns) < 0.1
    assert abs(span / refined - turns) <= abs(span / rough - turns) + 0.02


def test_a_refined_period_stays_between_its_limits() -> None:
    x = np.linspace(0.0, 1.0, 20_000)
    assert refined_period(x, np.sin(2.0 * np.pi * x / 0.45), 0.383, 0.01, 0.4) <= 0.4
    assert refined_period(x, np.sin(2.0 * np.pi * x / 0.45), 0.5, 0.01, 0.2) == 0.5


@given(st.integers(0, 1000), st.floats(0.5, 30.0))
@settings(max_examples=30)
def test_the_share_is_that_of_lomb_and_scargle_with_a_free_mean(seed: int, order: float) -> None:
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0.0, 6.0, 300))
    signal = rng.normal(size=300) + np.sin(order * x) + 2.0
    expected = lombscargle(x, signal, [order, 40.0], normalize=True, floating_mean=True)[0]
    assert harmonic_share(order * x, signal) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("x", [np.zeros(0), np.linspace(0.0, 1.0, 50), np.linspace(0.0, 0.03, 5000)])
def test_a_few_rows_and_a_short_way_have_no_period(x: np.ndarray) -> None:
    assert strongest_periods(x, np.sin(700.0 * x), 1e-3, 0.01, 3) == []


def test_a_spindle_that_turns_a_million_times_its_shortest_period_needs_little_memory() -> None:
    x = np.linspace(0.0, 60_000.0, 20_000)
    assert strongest_periods(x, np.sin(2.0 * np.pi * x / 50.0), 1e-4, 1e-3, 1) == pytest.approx([50.0], rel=0.01)


def test_no_period_lies_between_limits_that_exclude_each_other() -> None:
    """Counts of an unknown size may travel a thousand kilometres: no bins of a hundredth of a millimetre are made."""
    position = np.linspace(0.0, 1e6, 5000)
    assert strongest_periods(position, np.sin(position), 1.0, 10.0, 1, longest=1e-5) == []
