"""Find spikes: single values of a position that the axis cannot have reached, from a wrong reading or a disturbance."""

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

_BESIDE = 5  # rows on each side whose deviations tell how the axis moves there
_FAR = 8.0  # times the largest deviation of the rows beside it: a jerk of the axis shows in several rows
_RARE = 10.0  # times the median deviation: of white noise the largest of ten million rows is 7.7
_FEW = 0.01  # share of the rows: more are no accidents of a sensor


def lone_values(position: FloatArray) -> NDArray[np.bool_]:
    """Rows (n,) at which a position lies off the line between its neighbours, while the rows around it lie on theirs.

    A turning point within one row is none: it lies on the straight line of the rows before, or of those after. No row
    is returned if more than `_FEW` of them are off.
    """
    lone = np.zeros(position.size, dtype=np.bool_)
    if position.size <= 2 * _BESIDE + 1 or not np.isfinite(position).all():
        return lone
    off = np.zeros(position.size)
    off[1:-1] = np.abs(position[1:-1] - 0.5 * (position[:-2] + position[2:]))
    if not off.any():
        return lone
    rows = np.flatnonzero(off > _RARE * np.median(off[off > 0.0]))
    rows = rows[(rows >= _BESIDE) & (rows < position.size - _BESIDE)]
    # a value that is off moves the deviations of its direct neighbours by half: they are no measure of the motion
    offsets = np.array([row for row in range(-_BESIDE, _BESIDE + 1) if abs(row) > 1])
    around = off[rows[:, None] + offsets].max(axis=1)
    between = np.abs(position[rows + 1] - position[rows - 1])
    ways = [np.abs(position[rows] - 2.0 * position[rows + one] + position[rows + 2 * one]) for one in (-1, 1)]
    found = rows[(off[rows] > _FAR * around) & (off[rows] > between) & (np.minimum(*ways) > 0.5 * off[rows])]
    if found.size <= _FEW * position.size:
        lone[found] = True
    return lone
