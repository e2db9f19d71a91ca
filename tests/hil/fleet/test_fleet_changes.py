"""Change points: places and sizes of known changes within their errors, and how seldom there are false ones."""

from __future__ import annotations

import numpy as np
import pytest

from hil.fleet.changes import FEWEST, LOOKS, history, threshold_of

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


@pytest.mark.parametrize("kind", ["white", "correlated", "outliers"])
def test_what_only_scatters_has_no_change(kind: str) -> None:
    """In 60 series at most what the bound allows of one quantity in as many years: 60 / 14."""
    rng, false = np.random.default_rng(3), 0
    for _ in range(60):
        values = rng.standard_normal(90)
        if kind == "correlated":
            for at in range(1, 90):
                values[at] = 0.5 * values[at - 1] + np.sqrt(0.75) * values[at]
        if kind == "outliers":
            values[rng.integers(90, size=3)] *= 8.0
        found = looked_at(values)
        false += bool(found.changes or found.now.slope)  # type: ignore[attr-defined]
    assert false <= 60 / QUANTITIES


def test_the_threshold_is_that_of_one_false_change_a_year() -> None:
    """Bonferroni over all looks of a year, all places, steps and slopes, and all quantities; many recordings."""
    from scipy.stats import chi2

    count = 100_000  # of which the variance is known
    chance = float(chi2.sf(threshold_of(count, QUANTITIES), 1))
    assert LOOKS * 2 * count * QUANTITIES * chance == pytest.approx(1.0, rel=0.02)
    assert threshold_of(20, QUANTITIES) > threshold_of(200, QUANTITIES)


def test_too_few_recordings_tell_nothing() -> None:
    assert history(np.arange(FEWEST - 1.0), np.zeros(FEWEST - 1), np.ones(FEWEST - 1)) is None


def test_values_without_any_scatter_have_no_change() -> None:
    found = looked_at(np.full(40, 2.0), 0.0)
    assert (found.changes, found.now.begin) == ((), 2.0)  # type: ignore[attr-defined]
