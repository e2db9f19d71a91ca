"""Fewer points for a screen: the least and the greatest value of each stretch of rows, in the order in which they came.

Stretches begin at multiples of `step` of the row number, so that rows that come later change no point drawn before.
"""

from __future__ import annotations

import numpy as np

from hil.arrays import FloatArray


def stretch(rows: int, points: int) -> int:
    """Rows for each pair of points, so that `rows` rows give `points` points at most; 1: every row is a point."""
    return 1 if rows <= points else -(-2 * rows // points)


def min_max(values: FloatArray, step: int) -> FloatArray:
    """Reduce traces (traces, n) to (traces, m): of each `step` rows two points, the extreme that came first in front.

    The last stretch may be shorter. step 1 returns the values.
    """
    if step == 1 or not values.shape[1]:
        return values
    traces, rows = values.shape
    whole = rows // step * step
    pairs = _extremes(values[:, :whole].reshape(traces, whole // step, step))
    return pairs if whole == rows else np.hstack((pairs, _extremes(values[:, None, whole:])))


def _extremes(blocks: FloatArray) -> FloatArray:
    """Extremes of blocks (traces, blocks, n) in their order, (traces, 2 blocks)."""
    least, greatest = blocks.argmin(axis=2), blocks.argmax(axis=2)
    at = np.stack((np.minimum(least, greatest), np.maximum(least, greatest)), axis=2)
    return np.asarray(np.take_along_axis(blocks, at, axis=2).reshape(len(blocks), 2 * blocks.shape[1]))


def point_times(time_s: FloatArray, step: int) -> FloatArray:
    """Times (m,) at which the points of `min_max` are drawn: at the begin and in the middle of each stretch."""
    if step == 1 or not time_s.size:
        return time_s
    begins = np.arange(0, time_s.size, step)
    middles = np.minimum(begins + step // 2, (begins + time_s.size) // 2)
    return np.asarray(time_s[np.stack((begins, middles), axis=1).ravel()])
