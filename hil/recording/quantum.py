"""Quantisation step of a channel, from its values."""

import numpy as np

from hil.arrays import FloatArray

_WHOLE = 0.05  # deviation from a whole number of steps up to which a difference is counted
_COUNTED = 0.9  # share of the differences that must be whole numbers of steps
_FEWEST = 100  # differences that tell a step
SINGLE = 2.5e-7  # of a number: rounding in single precision, both ways
_STEPS = (20, 60, 200, 600)  # largest differences that are counted, in steps

DIGITS = 1e-6  # relative deviation from a power of ten below which a step is that of printed digits


def is_decimal(step: float, tolerance: float = DIGITS) -> bool:
    """True for a power of ten within a relative tolerance: the last digit of the file, no count of an encoder."""
    power = np.log10(step)
    return bool(abs(power - np.round(power)) < tolerance / np.log(10.0))


def count_of(values: FloatArray) -> float | None:
    """Step of a quantised channel (n,) in its unit; None where differences are no multiples of one step.

    At a constant speed all differences from row to row are one multiple; there those between them tell the step.
    """
    changes = np.diff(values)
    step = _step(changes, values)
    if step is None or np.ptp(np.round(np.abs(changes) / step)) > 0.0:
        return step
    bends = np.diff(changes)
    if np.count_nonzero(np.abs(bends) > SINGLE * np.max(np.abs(values))) < _FEWEST:
        return step
    finer = _step(bends, values)
    return None if finer is None else min(step, finer)


def _step(changes: FloatArray, values: FloatArray) -> float | None:
    """Step of which changes (m,) of values (n,) are multiples."""
    differences = np.abs(changes)
    differences = differences[differences > 1e-12 * np.ptp(values)]
    if differences.size < _FEWEST:
        return None
    step = float(differences.min())
    # the smallest difference has the largest error of printed digits: ever larger ones sharpen the step
    for most in _STEPS:
        few = differences[differences < most * step]
        whole = np.maximum(np.round(few / step), 1.0)
        step = float((few @ whole) / (whole @ whole))
    good = np.abs(few / step - np.round(few / step)) < _WHOLE
    return step if few.size > 50 and good.mean() > _COUNTED else None
