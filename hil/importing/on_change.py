"""Columns whose cells are empty while the value holds: it is written only when it changes."""

from collections.abc import Mapping

import numpy as np

from hil.arrays import FloatArray
from hil.recording.quantum import count_of

_RARELY = 0.05  # share of empty cells below which a column holds its values if another one of the file does
_LEAST = 0.02  # share of empty cells: fewer are lost rows
_DIFFER = 0.99  # share of the written values that differ from the one before
# Share of the change over the empty cells that lost rows of a motion would bring: all of it, and a value that holds one
# row of all.
_LOST = 0.75
_FEW = 3  # empty places before two written values, and written values: fewer tell nothing
_LEAST_STEPS = 40  # reversals of a noisy value, and steps by one digit, without one step by none: no chance
_ONE = 1.5  # digits: a smaller step is one by one digit


def columns_on_change(columns: Mapping[str, FloatArray]) -> list[str]:
    """Names of the columns (n,) that are written on change; with one of them also those that rarely are empty."""
    told = [name for name, values in columns.items() if written_on_change(values)]
    return [name for name, values in columns.items() if name in told or (told and _may_hold(values))]


def _may_hold(values: FloatArray) -> bool:
    given = values[np.isfinite(values)]
    return 0.0 < 1.0 - given.size / values.size < _RARELY and bool(np.diff(given).all())


def written_on_change(values: FloatArray) -> bool:
    """True if the missing values of a column (n,) are those of a value that holds.

    Each written value then differs from the one before. Two things tell it from values that were lost. Of a noisy value
    with few digits: many steps are by one digit, so that half as many would be by none, but none is. Else: over k empty
    cells it changes by one step of the rows that follow, where rows that were lost in a motion bring k + 1.
    """
    given = np.flatnonzero(np.isfinite(values))
    if given.size < _FEW or given.size > (1.0 - _LEAST) * values.size:
        return False
    steps, rows = np.diff(values[given]), np.diff(given)
    change = np.abs(steps)
    digit = count_of(values[given])
    turns = np.sum(steps[1:] * steps[:-1] < 0.0)
    if digit is not None and change.all() and min(turns, np.sum(change < _ONE * digit)) >= _LEAST_STEPS:
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
