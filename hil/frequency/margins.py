"""Stability margins of an open loop L(f), given at frequencies.

    gain margin     1 / |L| where the phase of L is -180 deg
    phase margin    phase of -L where |L| = 1
    delay margin    phase margin / (2 pi f): dead time that the loop still bears
    modulus margin  min |1 + L|: distance to the critical point, 1 / the peak of the sensitivity

Source: Åström, Murray: Feedback Systems (2008), ch. 9. Between given frequencies, log |L| and the phase are straight
over log f.
"""

from dataclasses import dataclass
from math import nan, pi

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

ComplexArray = NDArray[np.complex128]
DB_PER_NEPER = 20.0 / np.log(10.0)


@dataclass(frozen=True)
class StabilityMargins:
    """Margins of a loop, each with the frequency [Hz] at which it is met; NaN where the loop has none there.

    `gain_db` [dB]: by how much the gain may rise; `gain_down_db`: by how much it may fall. Of several crossings the
    nearest to instability counts. `*_std`: standard errors that a measured loop passes on.
    """

    gain_db: float
    gain_hz: float
    gain_down_db: float
    gain_down_hz: float
    phase_deg: float
    crossover_hz: float
    delay_s: float
    delay_hz: float
    modulus: float
    modulus_hz: float
    gain_std_db: float = nan
    phase_std_deg: float = nan
    delay_std_s: float = nan
    modulus_std: float = nan


def stability_margins(
    frequency_hz: FloatArray, loop: ComplexArray, std_error: FloatArray | None = None
) -> StabilityMargins:
    """Margins of an open loop (k,) at ascending frequencies (k,) [Hz]; `std_error` (k,) is that of |dL|.

    Raises ValueError for fewer than two frequencies.
    """
    if frequency_hz.size < 2:
        raise ValueError(f"frequency_hz: given {frequency_hz.size} frequencies, allowed two or more")
    log_f, log_gain = np.log(frequency_hz), np.log(np.abs(loop))
    turned = np.unwrap(np.angle(-loop))  # 0 on the negative real axis
    relative = np.full(frequency_hz.size, nan) if std_error is None else std_error / np.abs(loop)

    turns = np.floor(turned / (2.0 * pi))
    at = _crossings(np.where(np.diff(turns) != 0.0)[0], turned, 2.0 * pi * np.maximum(turns[1:], turns[:-1]))
    gains = [(-DB_PER_NEPER * _between(log_gain, p), float(np.exp(_between(log_f, p))), p) for p in at]
    up = min((one for one in gains if one[0] > 0.0), default=(nan, nan, nan))
    down = max((one for one in gains if one[0] <= 0.0), default=(nan, nan, nan))

    at = _crossings(np.where(np.diff(log_gain > 0.0))[0], log_gain, np.zeros(frequency_hz.size - 1))
    phases = [(_between(turned, p), float(np.exp(_between(log_f, p))), p) for p in at]
    wrapped = [((phase + pi) % (2.0 * pi) - pi, hz, p) for phase, hz, p in phases]
    phase, crossover_hz, place = min(wrapped, key=lambda one: abs(one[0]), default=(nan, nan, nan))
    delays = [(phase % (2.0 * pi) / (2.0 * pi * hz), hz, p) for phase, hz, p in phases]
    delay_s, delay_hz, late = min(delays, default=(nan, nan, nan))

    nearest = int(np.argmin(np.abs(1.0 + loop)))
    return StabilityMargins(
        gain_db=float(up[0]),
        gain_hz=up[1],
        gain_down_db=float(-down[0]),
        gain_down_hz=down[1],
        phase_deg=float(np.degrees(phase)),
        crossover_hz=crossover_hz,
        delay_s=delay_s,
        delay_hz=delay_hz,
        modulus=float(np.abs(1.0 + loop[nearest])),
        modulus_hz=float(frequency_hz[nearest]),
        # half of the power of a circular error lies along the radius, half across it
        gain_std_db=float(DB_PER_NEPER * _between(relative, up[2]) / np.sqrt(2.0)),
        phase_std_deg=float(np.degrees(_between(relative, place)) / np.sqrt(2.0)),
        delay_std_s=float(_between(relative, late) / (np.sqrt(8.0) * pi * delay_hz)),
        modulus_std=nan if std_error is None else float(std_error[nearest] / np.sqrt(2.0)),
    )


def _crossings(intervals: NDArray[np.intp], values: FloatArray, levels: FloatArray) -> list[float]:
    """Places at which values (k,) pass the level (k - 1,) of an interval, as an index with its fraction."""
    return [float(i + (levels[i] - values[i]) / (values[i + 1] - values[i])) for i in intervals]


def _between(values: FloatArray, place: float) -> float:
    """Value (k,) at an index with a fraction; NaN for NaN."""
    return nan if np.isnan(place) else float(np.interp(place, np.arange(values.size), values))
