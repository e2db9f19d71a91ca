"""Columns of a slower rate than the rows of a file: they have a value in one row of several."""

import numpy as np

from hil.arrays import FloatArray

_FEW = 10  # values, at most, that tell no rate
_EVEN = 0.95  # share of the steps within a row of the usual one: others are lost values
_COVERED = 0.9  # share of the rows that values at the usual step cover: less ends early


def rows_per_value(values: FloatArray) -> float | None:
    """Rows in which a column (n,) of a slower rate has one value; None of a column of another kind."""
    at = np.flatnonzero(np.isfinite(values))
    steps = np.diff(at)
    usual = float(np.median(steps)) if at.size > _FEW else 1.0
    if usual < 2.0 or np.mean(np.abs(steps - usual) <= 1.0) < _EVEN or at.size * usual < _COVERED * values.size:
        return None
    return usual
