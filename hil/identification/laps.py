"""Repeated motion in a recording: rows whose set-points come again after a lag."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from hil.arrays import FloatArray

Rows = NDArray[np.intp]

_LAGS = 6  # strongest lags of the set-points that are tried
_NEAR = 30  # rows about a peak of the correlation in which the lag is sought
_SAME_M = 2e-6  # set-points closer than this are the same: printed ones are rounded
_SETTLED_S = 0.3  # set-points must have been the same for so long: friction and play have a memory
_ENOUGH_S = 1.0  # of repeated motion, to call a floor measured


@dataclass(frozen=True, eq=False)
class Laps:
    """Rows whose set-points come again, and the rows where they do, each (m,)."""

    first: Rows
    again: Rows
    lag_s: float  # the lag with the most rows

    def noise(self, residual: FloatArray) -> float:
        """Standard deviation of the non-repeating part of a residual (n,)."""
        return float(np.sqrt(np.mean((residual[self.first] - residual[self.again]) ** 2) / 2.0))


def find_laps(position: FloatArray, velocity: FloatArray, period_s: float) -> Laps | None:
    """Rows of set-points (n,) [m, m/s] that repeat after a lag; None where less than a second of motion does."""
    matched = np.zeros(position.size, dtype=bool)
    settled = max(round(_SETTLED_S / period_s), 1)
    first, again, best, longest = list[Rows](), list[Rows](), 0.0, 0
    # neighbouring laps first, and each row once: distant laps also differ by drift
    for lag in sorted(_lags(position, velocity)):
        same = np.abs(position[:-lag] - position[lag:]) < _SAME_M
        # the same for a while before: a running count since the last difference
        different = np.flatnonzero(~same)
        since = np.full(same.size, -1)
        since[different] = different
        since = np.arange(same.size) - np.maximum.accumulate(since)
        moving = np.abs(velocity[:-lag]) > 1e-3 * np.max(np.abs(velocity))
        rows = np.flatnonzero((since > settled) & moving & ~matched[:-lag])
        matched[rows] = True
        first.append(rows)
        again.append(rows + lag)
        if rows.size > longest:
            best, longest = lag * period_s, rows.size
    if longest * period_s < _ENOUGH_S:
        return None
    return Laps(np.concatenate(first), np.concatenate(again), best)


def _lags(position: FloatArray, velocity: FloatArray) -> list[int]:
    """Lags [rows] at which the set-points resemble themselves most, best first."""
    n = velocity.size
    correlation = correlate(velocity, velocity, method="fft")[n - 1 :]
    peaks = (
        np.flatnonzero(
            (correlation[1:-1] > correlation[:-2])
            & (correlation[1:-1] >= correlation[2:])
            & (correlation[1:-1] > 0.05 * correlation[0])
        )
        + 1
    )
    # the shorter the overlap, the smaller the sum: its peaks stand a few rows too early
    found = (
        min(
            range(max(peak - _NEAR, 1), min(peak + _NEAR, n - 1)),
            key=lambda lag: float(np.mean(np.abs(position[: n - lag : 7] - position[lag::7]))),
        )
        for peak in peaks[np.argsort(correlation[peaks])[::-1][:_LAGS]].tolist()
    )
    return list(dict.fromkeys(found))
