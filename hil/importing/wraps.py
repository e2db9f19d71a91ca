"""Unwrap counters and angles that start again at the end of their range."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.importing.column_names import Label
from hil.quantities import UNITS

WHOLE_RANGE = 0.8  # of the spread of the values: a smaller jump is no wrap
_SUDDEN = 5.0  # times the change of the rows around: a motion changes its speed gradually
_STRAIGHT = 0.5  # of the path around a wrap in one direction: noise goes to and fro
_AROUND = 5  # rows before and after, which must run against the jump
_STAYS = 3  # rows after a wrap without another jump: a spike comes back at once
_SEVERAL, _ALIKE = 3, 0.8  # jumps by one usual range, and their share: a fast motion, beside which they are not sudden
_FEW_VALUES = 20  # of a switched signal, whose steps are no wraps
_OWN = 0.1  # of the range: by how much a velocity of this column may miss its way in a row
_LOST = 0.01  # of the rows: a spike of a velocity loses no angle
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

    A wrap is a jump over the whole range against the motion before and after it. It is sudden; beside a motion that
    goes a large part of its range in a row, several are by one usual range.
    """
    finite = values[np.isfinite(values)]
    spread = float(np.ptp(finite)) if finite.size else 0.0
    if finite.size < 2 * _AROUND + 2 or spread == 0.0 or np.unique(finite).size < _FEW_VALUES:
        return None
    change = np.diff(finite)
    found = _jumps(change, spread, WHOLE_RANGE)
    if found.sudden > 0.5 * found.all:
        size = float(np.median(found.ranges))
        if np.ptp(found.ranges) > 2.0 * _SAME * size:
            return None
        return _usual(size) or float(f"{size:.4g}")
    fast = _jumps(change, spread, 0.5)
    if len(fast.ranges) < _SEVERAL or fast.backwards <= 0.5 * fast.all:
        return None
    size = float(np.median(fast.ranges))
    alike = float(np.mean(np.abs(np.array(fast.ranges) - size) < _CLOSE * size))
    return _usual(size) if alike >= _ALIKE else None


class _Jumps(NamedTuple):
    """Number of all jumps, of those against the motion around them and of the sudden ones of these; their ranges."""

    all: int
    backwards: int
    sudden: int
    ranges: list[float]


def _jumps(change: FloatArray, spread: float, least: float) -> _Jumps:
    """The jumps among changes (m,) from row to row that are larger than a share of the spread of the values."""
    rows = np.flatnonzero(np.abs(change) > least * spread)
    ranges, backwards, sudden = list[float](), 0, 0
    for row in rows:
        around = np.r_[change[max(row - _AROUND, 0) : row], change[row + 1 : row + 1 + _AROUND]]
        around = around[np.abs(around) < 0.5 * spread]
        if around.size < _AROUND or np.any(np.abs(change[row + 1 : row + 1 + _STAYS]) > 0.5 * spread):
            continue
        speed = float(np.median(around))
        if np.abs(around.sum()) < _STRAIGHT * np.abs(around).sum():
            continue
        against = speed * change[row] < 0.0
        backwards += against
        sudden += against and bool(abs(change[row]) > _SUDDEN * np.max(np.abs(around)))
        ranges.append(abs(float(change[row]) - speed))
    return _Jumps(rows.size, backwards, sudden, ranges)


def _usual(size: float) -> float | None:
    """The usual range that a size is within its errors; None if it is none."""
    usual = min(_USUAL, key=lambda one: abs(size / one - 1.0))
    return float(usual) if abs(size / usual - 1.0) < _CLOSE else None


def unwrapped(values: FloatArray, size: float) -> FloatArray:
    """The column (n,) without wraps: each change is taken by the shortest way round; NaN stays."""
    good = np.isfinite(values)
    result = values.copy()
    result[good] = np.unwrap(values[good], period=size)
    return result


def lost_by(
    name: str, size: float, columns: Mapping[str, FloatArray], labels: Mapping[str, Label], period_s: float
) -> str:
    """The measured velocity by which a column moves half of its range or more from row to row; "" without one.

    Such a column cannot be unwrapped: the shortest way round is not its way. The velocity is its own if both, in known
    units, agree modulo the range; that of another shaft does not.
    """
    si, factor = UNITS.get(labels[name].unit or "", ("", 1.0))
    for other, values in columns.items():
        of, per_s = UNITS.get(labels[other].unit or "", ("", 1.0))
        if not si or of != f"{si}/s" or labels[other].command:
            continue
        turns = 0.5 * (values[1:] + values[:-1]) * per_s * period_s / (size * factor)
        gone = np.diff(columns[name]) / size
        fast = np.isfinite(turns) & np.isfinite(gone) & (np.abs(turns) > 0.5)
        rests = [np.mod(gone[fast] - sign * turns[fast] + 0.5, 1.0) - 0.5 for sign in (1.0, -1.0)]
        own = any(np.mean(np.abs(rest) < _OWN) > _ALIKE for rest in rests if rest.size)
        if own and np.count_nonzero(fast) > _LOST * values.size:
            return other
    return ""
