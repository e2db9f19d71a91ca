"""Tell columns that count rows or time from columns of a motion: they rise by the same step from row to row."""

import numpy as np

from hil.arrays import FloatArray
from hil.importing.stamp_columns import counted_on, range_of

COUNTER = "rises by the same step from row to row: a counter or a clock, no channel of the motion"
_SAME_STEP = 1e-6  # of the largest value: the rounding of printed digits; no motion is as even
_EVEN = 0.01  # of a step, at most: beside a large first value the rounding says nothing
_LOST = 0.05  # most steps that are multiples of the usual one, where rows are missing


def counts_rows(values: FloatArray) -> bool:
    """True for whole numbers (n,) that rise by one from row to row, or by more where rows are missing."""
    steps = np.diff(values)
    rises = bool(steps.size and np.isfinite(steps).all() and steps.min() >= 1.0)
    return rises and float(np.median(steps)) == 1.0 and bool(np.all(steps == np.round(steps)))


def rises_evenly(values: FloatArray) -> bool:
    """True for a column (n,) that rises by one step from row to row, or by its multiples where rows are missing.

    A range such as 2^16 at which a counter starts again is counted on.
    """
    if not np.isfinite(values).all() or values.size < 3:
        return False
    steps = np.diff(counted_on(values, range_of(values)))
    usual = float(np.median(steps))
    if usual <= 0.0:
        return False
    multiples = steps / usual
    rounding = min(_SAME_STEP * float(np.abs(values).max()), _EVEN * usual)
    whole = np.abs(multiples - np.round(multiples)) * usual <= rounding
    again = np.round(multiples) == 1.0
    return bool(np.all(whole) and np.all(multiples > 0.5) and np.mean(~again) <= _LOST)
