"""Torque and its regressors for a draft: every column through the same filters, the torque at the time of the motion.

The steps of `hil.identification.inverse_dynamics` with three differences, since its published values are those of one
well sampled axis: the torque and the sign of the velocity pass the filter of the position too, differences are of sixth
order, whose gain at a quarter of the rate is 0.85 and not 0.64, and the torque is shifted in time.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import correlate1d
from scipy.signal import butter, cheby1, sosfiltfilt

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.identification.coordinates import MOST_DELAY
from hil.identification.inverse_dynamics import BUTTERWORTH_ORDER, CHEBYSHEV_ORDER, CORNER, CUT_AT_START, RIPPLE_DB
from hil.recording.recording import Recording

LEAST_ROWS = 80  # after decimation: eight per block of the error estimate
# Least low-passed sign of the velocity of a row that is fitted: below, the filter mixes the friction of both directions
# and of rest, and its change near a reversal, where the acceleration is largest, looks like an inertia.
SLIDES = 0.9
# central difference of sixth order: gain 1 - (w T)^6 / 140
_DIFFERENCE = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
_EDGE = 3


def torque_columns(
    recording: Recording, cutoff_hz: float, decimation: int, over_position: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Regressors (n, 4 + k) for inertia, viscous, Coulomb, offset and k functions (rows,) of the position; torque (n,).

    The rows in which the axis slides, where there are enough of them.

    Raises InputError if the record does not move both ways.
    """
    names, period_s = recording.axis, recording.period_s
    low_pass = butter(BUTTERWORTH_ORDER, 2.0 * cutoff_hz * period_s, output="sos")
    position, torque, *functions = (
        _both_ways(low_pass, values)
        for values in (recording[names.motor_position], recording[names.torque], *over_position)
    )
    velocity = _difference(position, period_s)
    if not velocity.min() < 0.0 < velocity.max():
        raise InputError(
            f"{recording.name}: {names.motor_position}: given motion in one direction, allowed "
            "both; Coulomb friction and offset are not separable in one direction: record a return move"
        )
    columns: tuple[FloatArray, ...] = (
        _difference(velocity, period_s),
        velocity,
        _both_ways(low_pass, np.sign(velocity)),
        np.ones_like(velocity),
        *functions,
    )
    less = cheby1(CHEBYSHEV_ORDER, RIPPLE_DB, CORNER / decimation, output="sos")
    columns = (*columns, _difference(torque, period_s), torque)
    table = np.column_stack([_decimated(less, column[CUT_AT_START:], decimation) for column in columns])
    slides = np.abs(table[:, 2]) > SLIDES
    table = table[slides] if np.count_nonzero(slides) >= LEAST_ROWS else table
    regressors, slope, given = table[:, :-2], table[:, -2], table[:, -1]
    return regressors, given - _delay_s(regressors, slope, given, period_s) * slope


def _delay_s(matrix: FloatArray, slope: FloatArray, torque: FloatArray, period_s: float) -> float:
    """Time by which the torque (n,) is late, from its `slope` (n,): torque = matrix c + delay slope.

    The mean from a row to the next is half a row early; one that is early makes viscous friction too small.
    """
    delay_s = float(np.linalg.lstsq(np.column_stack([matrix, slope]), torque, rcond=None)[0][-1])
    return float(np.clip(delay_s, -MOST_DELAY * period_s, MOST_DELAY * period_s))


def _difference(values: FloatArray, period_s: float) -> FloatArray:
    """Derivative (n,) of values (n,), at both ends by differences of first order."""
    found = np.asarray(correlate1d(values, _DIFFERENCE, mode="nearest"), dtype=np.float64)
    ends = np.gradient(values)
    found[:_EDGE], found[-_EDGE:] = ends[:_EDGE], ends[-_EDGE:]
    return found / period_s


def _both_ways(sections: FloatArray, values: FloatArray) -> FloatArray:
    """Filter without phase, the ends padded by three times the order of the filter."""
    return np.asarray(sosfiltfilt(sections, values, padlen=6 * len(sections)), dtype=np.float64)


def _decimated(sections: FloatArray, values: FloatArray, decimation: int) -> FloatArray:
    """Low-passed values (n,), every `decimation`-th, counted from the end."""
    return _both_ways(sections, values)[(values.size - 1) % decimation :: decimation]
