"""From which moment on a coefficient of the plain model is another one: found where it is, and not in noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.diagnosis.moment_of_change import moment_of_change, steady_change
from hil.identification.structure import ResidualSeries

ROWS, PERIOD_S = 12000, 2e-3
TIME_S = PERIOD_S * np.arange(ROWS)
COLUMNS = {
    "inertia": -40.0 * np.sin(1.7 * TIME_S) - 90.0 * np.sin(5.3 * TIME_S),
    "viscous": 23.0 * np.cos(1.7 * TIME_S) + 17.0 * np.cos(5.3 * TIME_S),
    "coulomb": np.sign(23.0 * np.cos(1.7 * TIME_S) + 17.0 * np.cos(5.3 * TIME_S)),
    "offset": np.ones(ROWS),
}


def coloured(seed: int, correlation_s: float) -> np.ndarray:
    """Noise (n,) of unit deviation whose autocorrelation decays with the given time."""
    keep = np.exp(-PERIOD_S / correlation_s)
    white = np.random.default_rng(seed).normal(0.0, np.sqrt(1.0 - keep**2), ROWS)
    found = np.empty(ROWS)
    value = 0.0
    for row in range(ROWS):
        value = found[row] = keep * value + white[row]
    return found


@pytest.mark.parametrize("name", list(COLUMNS))
@pytest.mark.parametrize("at_s", [5.0, 16.0])
def test_the_coefficient_and_its_moment_are_found_over_two_parts(name: str, at_s: float) -> None:
    size = 0.8 / float(np.std(COLUMNS[name]) or 1.0)
    left = 0.2 * coloured(3, 0.05) + size * COLUMNS[name] * (at_s <= TIME_S)
    cut = 2 * ROWS // 3
    parts = [
        ResidualSeries(left[rows], np.abs(COLUMNS["viscous"][rows]) > 1.0)
        for rows in (slice(cut, None), slice(0, cut))  # their order is that of time, not of the list
    ]
    columns = [{key: one[rows] for key, one in COLUMNS.items()} for rows in (slice(cut, None), slice(0, cut))]
    found = moment_of_change(parts, columns, [TIME_S[cut:], TIME_S[:cut]])
    assert found is not None
    assert found.coefficient == name
    assert found.moment_s == pytest.approx(at_s, abs=0.3)
    assert found.change == pytest.approx(size, rel=0.1)
    assert found.course.p < 1e-3
    early, late = (found.course.means[rows].mean() for rows in (slice(0, 2), slice(-2, None)))
    assert late - early == pytest.approx(size, rel=0.2)


def test_a_part_that_begins_with_rows_of_the_one_before_it_comes_after_it() -> None:
    """Rows from which a twin gets its state do not count, and do not order the parts."""
    left = 0.1 * coloured(2, 0.02) + 0.02 * COLUMNS["viscous"] * (TIME_S >= 18.0)
    cut = ROWS // 2
    later = np.arange(ROWS) >= cut
    parts = [ResidualSeries(left, later), ResidualSeries(left[:cut], np.ones(cut, dtype=bool))]
    columns = [COLUMNS, {name: one[:cut] for name, one in COLUMNS.items()}]
    found = moment_of_change(parts, columns, [TIME_S, TIME_S[:cut]])
    assert found is not None
    assert found.moment_s == pytest.approx(18.0, abs=0.3)
    assert np.all(np.diff(found.course.edges) > 0.0)
    nothing = [part._replace(rows=np.zeros(part.left.size, dtype=bool)) for part in parts]
    assert moment_of_change(nothing, columns, [TIME_S, TIME_S[:cut]]) is None


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.01, 0.1, 0.5]))
def test_noise_changes_at_no_moment(seed: int, correlation_s: float) -> None:
    """The chance of 15 runs together is below 0.1 % at this level, also of noise that is slow."""
    found = moment_of_change(
        [ResidualSeries(coloured(seed, correlation_s), np.ones(ROWS, dtype=bool))], [COLUMNS], [TIME_S]
    )
    assert found is None or found.course.p > 1e-4


@pytest.mark.parametrize("correlation_s", [0.01, 0.3])
def test_a_rate_is_found_with_its_size_and_noise_has_none(correlation_s: float) -> None:
    """The chance of twenty draws together is below a per cent at this level."""
    rows = np.abs(COLUMNS["viscous"]) > 1.0
    noise = [coloured(seed, correlation_s) for seed in range(20)]
    found = [steady_change([ResidualSeries(one, rows)], [COLUMNS], [TIME_S], "viscous") for one in noise]
    assert min(one.course.p for one in found if one) > 1e-4
    rate = 2e-2
    left = noise[0] + rate * (TIME_S - 3.0) * COLUMNS["viscous"]
    steady = steady_change([ResidualSeries(left, rows)], [COLUMNS], [TIME_S], "viscous")
    assert steady is not None
    assert steady.rate == pytest.approx(rate, rel=0.2)
    assert steady.course.p < 1e-4
    assert steady.duration_s == pytest.approx(float(np.ptp(TIME_S[rows])))


def test_few_rows_and_a_column_of_zeros_tell_nothing() -> None:
    short = {name: one[:300] for name, one in COLUMNS.items()}
    assert moment_of_change([ResidualSeries(np.ones(300), np.ones(300, dtype=bool))], [short], [TIME_S[:300]]) is None
    still = COLUMNS | {"viscous": np.zeros(ROWS)}
    rows = ResidualSeries(coloured(1, 0.05), np.ones(ROWS, dtype=bool))
    assert moment_of_change([rows], [still], [TIME_S]) is None
