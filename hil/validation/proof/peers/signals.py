"""Signals for regressors: derivatives, directions, delayed and lagging torques.

All signals of an equation pass the same Gaussian, derivatives its derivative, so that equalities are kept. (A local
polynomial damps accelerations more than positions, which would look like a flexible mode.)
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import bilinear, lfilter

from hil.arrays import FloatArray

SMOOTH_S = 0.002  # standard deviation of the Gaussian: cut-off at 66 Hz
_TRUNCATE = 8.0  # standard deviations: derivatives of a constant are zero to rounding
_REACH = 4.0  # standard deviations with noticeable weight
SWAY_DAMPING = 0.03  # damping ratio of a mass on a spring
SLIDING_M_S = 1e-4  # at the table: what is slower counts as rest


def smooth(values: FloatArray, period_s: float, order: int = 0) -> FloatArray:
    """Filter a signal (n,) by the Gaussian, or return its derivative of an order."""
    filtered = gaussian_filter1d(values, SMOOTH_S / period_s, order=order, mode="nearest", truncate=_TRUNCATE)
    return np.asarray(filtered / period_s**order, dtype=np.float64)


def curvature(values: FloatArray, period_s: float) -> FloatArray:
    """Return the second difference (n,), for a signal that is smoothed later."""
    return np.asarray(np.pad(np.diff(values, 2), 1) / period_s**2, dtype=np.float64)


def at_rows(torque: FloatArray) -> FloatArray:
    """Return the torque (n,) at the instants of the rows; a row holds the mean over the following period."""
    return np.asarray(0.5 * (torque + np.concatenate([torque[:1], torque[:-1]])), dtype=np.float64)


def direction(velocity_m_s: FloatArray) -> FloatArray:
    """Return the sign of the last motion (n,), held at rest."""
    moving = np.flatnonzero(np.abs(velocity_m_s) > SLIDING_M_S)
    if not moving.size:
        return np.zeros(velocity_m_s.size)
    last = np.searchsorted(moving, np.arange(velocity_m_s.size), side="right") - 1
    return np.asarray(np.where(last < 0, 0.0, np.sign(velocity_m_s[moving[np.maximum(last, 0)]])), dtype=np.float64)


def sliding(velocity_m_s: FloatArray, period_s: float) -> NDArray[np.bool_]:
    """Return the rows (n,) with sliding in one direction within the reach of the Gaussian."""
    window = 2 * round(_REACH * SMOOTH_S / period_s) + 1
    moving = np.where(np.abs(velocity_m_s) > SLIDING_M_S, np.sign(velocity_m_s), 0.0)
    return np.asarray(np.abs(np.convolve(moving, np.ones(window), "same")) > window - 0.5, dtype=np.bool_)


def since_reversal(position: FloatArray, way: FloatArray) -> FloatArray:
    """Return the distance (n,) from the last reversal."""
    turns = np.flatnonzero(np.diff(way, prepend=way[0]) != 0.0)
    turns = np.concatenate([[0], turns])
    last = turns[np.searchsorted(turns, np.arange(way.size), side="right") - 1]
    return np.asarray(np.abs(position - position[last]), dtype=np.float64)


def delayed(torque: FloatArray, delay_s: float, period_s: float) -> FloatArray:
    """Return the means over each period of a held torque (n,) after a delay."""
    whole = math.floor(delay_s / period_s)
    f = delay_s / period_s - whole
    rows = np.arange(torque.size) - whole
    return np.asarray((1.0 - f) * torque[np.maximum(rows, 0)] + f * torque[np.maximum(rows - 1, 0)], dtype=np.float64)


def lagged(torque: FloatArray, time_constant_s: float, period_s: float) -> FloatArray:
    """Return the means over each period of a held torque (n,) after a first-order lag."""
    pole = math.exp(-period_s / time_constant_s)
    ends = lfilter([1.0 - pole], [1.0, -pole], torque)
    begins = np.concatenate([[0.0], ends[:-1]])
    return np.asarray(torque - (torque - begins) * time_constant_s / period_s * (1.0 - pole), dtype=np.float64)


def swayed(acceleration: FloatArray, frequency_hz: float, period_s: float) -> FloatArray:
    """Return the acceleration (n,) of a mass on a spring on an accelerated base."""
    omega = 2.0 * math.pi * frequency_hz
    b, a = bilinear([omega**2], [1.0, 2.0 * SWAY_DAMPING * omega, omega**2], 1.0 / period_s)
    return np.asarray(lfilter(b, a, acceleration), dtype=np.float64)
