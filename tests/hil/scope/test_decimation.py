"""Reduction to extremes: nothing between them is lost, and rows that come later change no point."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hil.scope.decimation import min_max, point_times, stretch

ROWS = st.integers(0, 200)
STEPS = st.integers(1, 40)
VALUES = st.integers(1, 3).flatmap(
    lambda traces: ROWS.flatmap(lambda rows: arrays(np.float64, (traces, rows), elements=st.floats(-1e3, 1e3)))
)


@given(VALUES, STEPS)
def test_each_stretch_keeps_its_extremes_in_their_order(values: np.ndarray, step: int) -> None:
    points = min_max(values, step)
    if step == 1:
        assert np.array_equal(points, values)
        return
    starts = range(0, values.shape[1], step)
    assert points.shape == (len(values), 2 * len(starts))
    for number, start in enumerate(starts):
        block = values[:, start : start + step]
        for trace, (first, second) in zip(block, points[:, 2 * number : 2 * number + 2], strict=True):
            assert {first, second} == {trace.min(), trace.max()}
            assert list(trace).index(first) <= list(trace).index(second)


@given(VALUES, STEPS, st.lists(st.integers(0, 5), max_size=8))
def test_rows_that_come_in_whole_stretches_give_the_points_of_all_at_once(
    values: np.ndarray, step: int, pieces: list[int]
) -> None:
    edges = [*np.minimum(np.cumsum([0, *pieces]) * step, values.shape[1]).tolist(), values.shape[1]]
    parts = [min_max(values[:, a:b], step) for a, b in pairwise(edges)]
    assert np.array_equal(np.hstack(parts), min_max(values, step))


@given(ROWS, STEPS)
def test_every_point_has_a_time_and_times_do_not_run_back(rows: int, step: int) -> None:
    time_s = np.arange(rows) * 1e-3
    times = point_times(time_s, step)
    assert times.shape == (min_max(time_s[None], step).shape[1],)
    assert np.all(np.diff(times) >= 0.0)
    assert set(times) <= set(time_s)


@given(st.integers(0, 100_000), st.integers(2, 5000))
def test_there_are_no_more_points_than_asked_for(rows: int, points: int) -> None:
    step = stretch(rows, points)
    assert -(-rows // step) * (1 if step == 1 else 2) <= points + 2
