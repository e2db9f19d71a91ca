"""Columns whose cells are empty while the value holds: it is written only when it changes."""

import numpy as np

from hil.arrays import FloatArray
from hil.recording.quantum import count_of

_LEAST = 0.02  # share of empty cells: fewer are lost rows
_DIFFER = 0.99  # share of the written values that differ from the one before
# Share of the change over the empty cells that lost rows of a motion would bring: all of it, and a value that holds one
# row of all.
_LOST = 0.75
_FEW = 3  # empty places before two written values, and written values: fewer tell nothing
_LEAST_TURNS = 20  # steps by one digit forwards and back: noise by which as many values would stay
_ONE = 1.5  # digits: below, a step is that by one


def written_on_change(values: FloatArray) -> bool:
    """True if the missing values of a column (n,) are those of a value that holds.

    Each written value then differs from the one before. Two things tell it from values that were lost. Of a noisy value
    with few digits: many steps are one digit forwards and back, so that many would be none, but none is. Else: over
    k empty cells it changes by one step of the rows that follow, where rows that were lost in a motion bring k + 1.
    """
    given = np.flatnonzero(np.isfinite(values))
    if given.size < _FEW or given.size > (1.0 - _LEAST) * values.size:
        return False
    steps, rows = np.diff(values[given]), np.diff(given)
    change = np.abs(steps)
    digit = count_of(values[given])
    if digit is not None and change.all():
        by_one = change < _ONE * digit
        if np.sum(by_one[1:] & by_one[:-1] & (steps[1:] * steps[:-1] < 0.0)) >= _LEAST_TURNS:
            return True
    places = np.flatnonzero((rows[:-1] > 1) & (rows[1:] == 1))
    if places.size < _FEW or np.mean(change > 0.0) < _DIFFER:
        return False
    return bool(change[places].sum() < _LOST * (rows[places] * change[places + 1]).sum())


def held(values: FloatArray) -> FloatArray:
    """The column (n,) with the last written value in each empty cell; the first one in those before it."""
    given = np.flatnonzero(np.isfinite(values))
    if not given.size:
        return values
    last = np.searchsorted(given, np.arange(values.size), side="right") - 1
    return values[given[np.maximum(last, 0)]]
