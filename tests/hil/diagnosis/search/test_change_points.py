"""Windows of constant level in a signal: found, joined, and told from a signal that is wrong everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from hil.diagnosis.search.change_points import Segment, joined, segments, standing_out

WINDOWS = [(30, 60, 2.0), (100, 104, -3.0), (200, 290, 0.8)]


def signal(noise: float, seed: int = 0) -> np.ndarray:
    values = np.random.default_rng(seed).normal(0.0, noise, 400)
    for first, last, level in WINDOWS:
        values[first:last] += level
    return values


@pytest.mark.parametrize("seed", range(5))
def test_every_window_is_found_with_its_edges_and_level(seed: int) -> None:
    found = segments(signal(0.2, seed), np.ones(400), 0.04, 25.0)
    assert [one[:2] for one in found] == [window[:2] for window in WINDOWS]
    assert [one.level for one in found] == pytest.approx([window[2] for window in WINDOWS], abs=0.3)


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_has_no_window(seed: int) -> None:
    assert segments(np.random.default_rng(seed).normal(0.0, 0.2, 2000), np.ones(2000), 0.04, 25.0) == []


def test_rows_that_are_not_known_do_not_end_a_window() -> None:
    values, weights = signal(0.1), np.ones(400)
    values[220:240], weights[220:240] = -50.0, 0.0
    found = joined(segments(values, weights, 0.01, 25.0), weights, 3, 0.25)
    assert [one[:2] for one in found] == [window[:2] for window in WINDOWS]


def test_the_slope_of_an_edge_is_part_of_its_window_and_another_level_is_not() -> None:
    weights = np.ones(400)
    edge = joined([Segment(10, 12, 1.0), Segment(12, 40, 2.0), Segment(40, 60, 5.0)], weights, 3, 0.25)
    assert edge == [Segment(10, 40, 2.0), Segment(40, 60, 5.0)]
    assert len(joined([Segment(10, 30, 2.0), Segment(30, 60, -2.0)], weights, 3, 0.25)) == 2


def test_a_window_must_stand_out_of_what_is_left_beside_it() -> None:
    values = signal(0.05)
    found = segments(values, np.ones(400), 0.0025, 25.0)
    assert len(standing_out(values, np.ones(400), found, 5.0, 2)) == 3
    wave = 2.0 * np.sin(np.arange(400) / 15.0)
    found = segments(wave, np.ones(400), 0.0025, 25.0)
    assert found
    assert standing_out(wave, np.ones(400), found, 5.0, 2) == []
