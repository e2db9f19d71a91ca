"""Laps: rows at which the motion of a recording repeats.

They give the part of a residual that does not repeat, which includes disturbances of the axis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate, find_peaks

from hil.arrays import FloatArray

Rows = NDArray[np.intp]

_LAGS = 6  # strongest peaks of the correlation that are tried: each row counts once, so more lags add few rows
_NEAR = 30  # rows about a peak of the correlation that are searched: the shrinking overlap shifts a peak by a few
_SAME_M = 2e-6  # set-points closer than this are the same: printed ones are rounded to 1 µm
_SETTLED_S = 0.3  # set-points must have been equal for this time: friction and play depend on the past
_LAP_ROWS = 500  # of a block: longer than the response of an axis, shorter than a lap
_ENOUGH_S = 1.0  # least repeated motion: 1000 rows at 1 kHz give the floor to a few per cent


@dataclass(frozen=True, eq=False)
class Laps:
    """Rows of repeated set-points, and the rows of their repetition, each (m,)."""

    first: Rows
    again: Rows

    def difference(self, residual: FloatArray) -> float:
        """Standard deviation of the non-repeating part of a residual (n,)."""
        return float(np.sqrt(np.mean((residual[self.first] - residual[self.again]) ** 2) / 2.0))

    def noise(self, residual: FloatArray) -> float:
        """Standard deviation of the part of a residual (n,) that neither repeats nor has structure in time.

        A push in one lap does not repeat either, but is no noise: the median over blocks of rows leaves it out.
        """
        squares = (residual[self.first] - residual[self.again]) ** 2 / 2.0
        blocks = squares[: squares.size // _LAP_ROWS * _LAP_ROWS].reshape(-1, _LAP_ROWS).mean(axis=1)
        return min(float(np.sqrt(np.median(blocks))), self.difference(residual)) if blocks.size else 0.0


def find_laps(position: FloatArray, velocity: FloatArray, period_s: float) -> Laps | None:
    """Find the rows of set-points (n,) [m, m/s] that repeat after a lag; None if less than a second repeats."""
    matched = np.zeros(position.size, dtype=bool)
    settled = max(round(_SETTLED_S / period_s), 1)
    first, again, longest = list[Rows](), list[Rows](), 0
    # short lags first, each row once: distant laps differ by drift
    for lag in sorted(_lags(position, velocity)):
        same = np.abs(position[:-lag] - position[lag:]) < _SAME_M
        # rows since the last difference
        different = np.flatnonzero(~same)
        since = np.full(same.size, -1)
        since[different] = different
        since = np.arange(same.size) - np.maximum.accumulate(since)
        moving = np.abs(velocity[:-lag]) > 1e-3 * np.max(np.abs(velocity))
        rows = np.flatnonzero((since > settled) & moving & ~matched[:-lag])
        matched[rows] = True
        first.append(rows)
        again.append(rows + lag)
        longest = max(longest, rows.size)
    if longest * period_s < _ENOUGH_S:
        return None
    return Laps(np.concatenate(first), np.concatenate(again))


def _lags(position: FloatArray, velocity: FloatArray) -> list[int]:
    """Lags [rows] of the largest autocorrelation of the set-points, best first."""
    n = velocity.size
    correlation = correlate(velocity, velocity, method="fft")[n - 1 :]
    peaks, _ = find_peaks(correlation, height=0.05 * correlation[0])
    # the sum decreases with the overlap, so that its peaks lie a few rows early
    lags = (
        min(
            range(max(peak - _NEAR, 1), min(peak + _NEAR, n - 1)),
            key=lambda lag: float(np.mean(np.abs(position[: n - lag : 7] - position[lag::7]))),
        )
        for peak in peaks[np.argsort(correlation[peaks])[::-1][:_LAGS]].tolist()
    )
    return list(dict.fromkeys(lags))
