"""Find the windows in which a signal is constant and not zero: optimal partitioning (Jackson et al. 2005).

    max over windows  sum of (sum of y)^2 / (count variance) - penalty

over the blocks of each window: the energy that a constant level removes there, less the cost of a window.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from hil.arrays import FloatArray


class Segment(NamedTuple):
    """Blocks `first` to `last` (exclusive) and their mean level."""

    first: int
    last: int
    level: float


def segments(values: FloatArray, weights: FloatArray, variance: float, penalty: float) -> list[Segment]:
    """Partition values (n,) into windows of constant level and a rest at zero, in order of time.

    `weights` (n,) are 0 where a value is not known, else 1. `variance` is that of one value.
    """
    count = np.concatenate([[0.0], np.cumsum(weights)])
    total = np.concatenate([[0.0], np.cumsum(weights * values)])
    begins = _partition(count, total, variance, penalty)
    windows, end = list[Segment](), values.size
    while end > 0:
        begin = int(begins[end])
        if begin >= 0:
            level = (total[end] - total[begin]) / max(count[end] - count[begin], 1.0)
            windows.append(Segment(begin, end, float(level)))
        end = begin if begin >= 0 else end - 1
    return windows[::-1]


@njit(cache=True, nogil=True)
def _partition(count, total, variance, penalty):  # type: ignore[no-untyped-def]
    """Begin (n + 1,) of the window that ends at each block in the best partition up to it; -1: no window ends there."""
    best, begins = np.zeros(count.size), np.full(count.size, -1)
    for end in range(1, count.size):
        best[end] = best[end - 1]
        for begin in range(end):
            removed = (total[end] - total[begin]) ** 2 / (max(count[end] - count[begin], 1.0) * variance)
            if best[begin] + removed - penalty > best[end]:
                best[end], begins[end] = best[begin] + removed - penalty, begin
    return begins


def joined(windows: list[Segment], weights: FloatArray, short: int, alike: float) -> list[Segment]:
    """Join windows of one sign with no known block between: `short` ones to their neighbour, and levels `alike`."""
    result = list[Segment]()
    for one in windows:
        before = result[-1] if result else None
        if before is None or weights[before.last : one.first].any() or before.level * one.level < 0.0:
            result.append(one)
            continue
        sizes = [float(weights[part.first : part.last].sum()) for part in (before, one)]
        close = abs(one.level - before.level) < alike * max(abs(one.level), abs(before.level))
        if close:
            level = float(np.average([before.level, one.level], weights=np.maximum(sizes, 1e-9)))
        elif min(sizes) <= short:
            level = before.level if sizes[0] > sizes[1] else one.level
        else:
            result.append(one)
            continue
        result[-1] = Segment(before.first, one.last, level)
    return result


def standing_out(
    values: FloatArray, weights: FloatArray, windows: list[Segment], least: float, margin: int
) -> list[Segment]:
    """Keep the windows whose level is `least` times the rms of the blocks beside all stronger windows.

    Where the model is wrong everywhere no window stands out. `margin` blocks about a window do not count: its edges.
    """
    ordered = sorted(windows, key=lambda one: -abs(one.level))
    beside, kept = weights > 0.0, 0
    for number, one in enumerate(ordered, 1):
        beside[max(one.first - margin, 0) : one.last + margin] = False
        if abs(one.level) > least * np.sqrt(np.mean(values[beside] ** 2) if beside.any() else np.inf):
            kept = number
    return sorted(ordered[:kept])
