"""A value that settles at another one while an axis warms up."""

import math

from numba import njit

from hil.twin.mechanism import Moment, Row


@njit
def settling(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    """The value times 1 + a (1 - exp(-t / tau)); `parameters` begin with a and tau [s]."""
    fraction, time_constant_s = parameters[0], parameters[1]
    if time_constant_s <= 0.0:
        return value * (1.0 + fraction)
    return value * (1.0 - fraction * math.expm1(-at.time_s / time_constant_s))
