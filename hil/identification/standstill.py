"""Rows of a recording at which the motor rests, as far as its encoder tells."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from hil.identification.measured import Measured

CREEP_S = 0.008  # time constant of the slowest observer
_SIGMAS = 3.0  # of the noise of a difference: a row in a thousand at rest seems to move


@lru_cache(maxsize=32)  # alike for all hypotheses of an axis
def resting(run: Measured, slow: float) -> NDArray[np.bool_]:
    """Rows (n,) at which the motor rests: its speed is below `slow` [motor units / s]; `creeping` if it is coarse.

    Where noise hides that speed from row to row, it is the travel within `CREEP_S` that must be below both.
    """
    if run.noise.coarse:
        return creeping(run)
    hidden, step = _SIGMAS * np.sqrt(2.0) * run.noise.motor, slow * run.period_s
    if hidden <= step:
        return np.asarray(np.abs(np.diff(run.motor, prepend=run.motor[:1])) <= step)
    rows = max(round(CREEP_S / run.period_s), 1)
    around = np.pad(run.motor, (rows // 2, rows - rows // 2), mode="edge")
    return np.asarray(np.abs(around[rows:] - around[:-rows]) <= max(hidden, rows * step))


def creeping(run: Measured) -> NDArray[np.bool_]:
    """Rows (n,) at which the motor passes less than a step of its recorded position within `CREEP_S`.

    The state of friction is not known there: an observer may rest anywhere within the band in which friction holds it.
    """
    rows = max(round(CREEP_S / run.period_s), 1)
    passed = np.abs(np.convolve(np.gradient(run.motor), np.ones(rows), mode="same"))
    return np.asarray(maximum_filter1d(passed < np.sqrt(12.0) * run.noise.motor, 8 * rows + 1), dtype=np.bool_)
