"""Columns whose cells are empty while the value holds: it is written only when it changes."""

import numpy as np

from hil.arrays import FloatArray

_LEAST = 0.02  # share of empty cells: fewer are lost rows
_DIFFER = 0.99  # share of the written values that differ from the one before
# Share of the change over the empty cells that lost rows of a motion would bring: all of it, and a value that holds one
# row of all.
_LOST = 0.75
_FEW = 3  # empty places before two written values, and written values: fewer tell nothing


def written_on_change(values: FloatArray) -> bool:
    """True if the missing values of a column (n,) are those of a value that holds.

    Each written value then differs from the one before, and over k empty cells it changes by one step of the rows that
    follow: rows that were lost in a motion bring k + 1 steps.
    """
    given = np.flatnonzero(np.isfinite(values))
    if given.size < _FEW or given.size > (1.0 - _LEAST) * values.size:
        return False
    change, rows = np.abs(np.diff(values[given])), np.diff(given)
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
