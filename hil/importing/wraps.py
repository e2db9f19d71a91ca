"""Unwrap counters and angles that start again at the end of their range."""

import numpy as np

from hil.arrays import FloatArray

WHOLE_RANGE = 0.8  # of the spread of the values: a smaller jump is no wrap
_SUDDEN = 5.0  # times the change of the rows around: a motion changes its speed gradually
_STRAIGHT = 0.5  # of the path around a wrap in one direction: noise goes to and fro
_AROUND = 5  # rows before and after, which must run against the jump
_STAYS = 3  # rows after a wrap without another jump: a spike comes back at once
_GRADUAL = 0.1  # of the range: most change of the way from row to row, of a motion that wraps within few rows
_FEW_VALUES = 20  # of a switched signal, whose steps are no wraps
_SAME = 0.1  # of the range: by how much the ranges of several wraps may differ
_CLOSE = 0.01  # relative deviation from a usual range
_USUAL = (
    360.0,
    2.0 * np.pi,
    180.0,
    3600.0,
    36000.0,
    1.0,
    100.0,
    1000.0,
    10000.0,
    *(2.0**power for power in range(8, 33)),
)


def wrap_range(values: FloatArray) -> float | None:
    """Range at which a column (n,) wraps, such as 65536 or 360; None if it does not.

    A wrap is a jump over the whole range against the motion before and after it. Where the motion goes a large part of
    a usual range in a row, unwrapping by that range makes it even.
    """
    finite = values[np.isfinite(values)]
    spread = float(np.ptp(finite)) if finite.size else 0.0
    if finite.size < 2 * _AROUND + 2 or spread == 0.0 or np.unique(finite).size < _FEW_VALUES:
        return None
    change = np.diff(finite)
    jumps = np.flatnonzero(np.abs(change) > WHOLE_RANGE * spread)
    ranges, backwards = [], 0
    for row in jumps:
        around = np.r_[change[max(row - _AROUND, 0) : row], change[row + 1 : row + 1 + _AROUND]]
        around = around[np.abs(around) < 0.5 * spread]
        if around.size < _AROUND or np.any(np.abs(change[row + 1 : row + 1 + _STAYS]) > 0.5 * spread):
            continue
        speed = float(np.median(around))
        if np.abs(around.sum()) < _STRAIGHT * np.abs(around).sum():
            continue
        backwards += speed * change[row] < 0.0 and abs(change[row]) > _SUDDEN * np.max(np.abs(around))
        ranges.append(abs(float(change[row]) - speed))
    if not ranges or backwards <= 0.5 * len(jumps):
        return _of_fast_motion(finite, spread)
    size = float(np.median(ranges))
    if np.ptp(ranges) > 2.0 * _SAME * size:
        return None
    usual = min(_USUAL, key=lambda one: abs(size / one - 1.0))
    return float(usual) if abs(size / usual - 1.0) < _CLOSE else float(f"{size:.4g}")


def _of_fast_motion(values: FloatArray, spread: float) -> float | None:
    """The usual range, little more than the spread, by which unwrapped values (n,) move evenly; None without one."""
    for size in _USUAL:
        if spread <= size <= spread / WHOLE_RANGE and np.max(np.abs(np.diff(values))) > 0.5 * size:
            way = np.diff(np.unwrap(values, period=size))
            if np.max(np.abs(np.diff(way))) < _GRADUAL * size:
                return size
    return None


def unwrapped(values: FloatArray, size: float) -> FloatArray:
    """The column (n,) without wraps: each change is taken by the shortest way round; NaN stays."""
    good = np.isfinite(values)
    result = values.copy()
    result[good] = np.unwrap(values[good], period=size)
    return result
