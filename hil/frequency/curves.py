"""A frequency response as data: its lines, their trustworthy range, its resonances."""

from dataclasses import dataclass, replace
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from hil.arrays import FloatArray

TRUSTED = 0.1  # relative standard error of a line that is trusted: 0.9 dB, 6 deg
WIDEST_GAP = 1.25  # of frequency between trusted lines: an antiresonance is a few lines wide
LEAST_LINES, LEAST_SPAN = 16, 4.0  # of a trusted range that shows a response
PROMINENCE_DB = 3.0  # of a resonance
SURE = 4.0  # standard errors that a resonance stands out


@dataclass(frozen=True, eq=False)
class ResponseCurve:
    """A response (k,) at ascending frequencies (k,) [Hz] in `unit`, e.g. "rad/(N m)".

    `std_error` (k,), in `unit`, is sqrt(E |error|^2) of the complex value, `radius` that of the circle which holds the
    true value with 95 %, in standard errors; `coherence` (k,) the smaller one of the two channels with the set-points.
    A curve of the twin has the errors 0 and the coherence 1.
    """

    title: str
    unit: str
    frequency_hz: FloatArray
    response: NDArray[np.complex128]
    std_error: FloatArray
    coherence: FloatArray
    radius: float = 0.0

    @property
    def trusted(self) -> NDArray[np.bool_]:
        """Lines (k,) with a relative standard error below a tenth, in the range of `trusted_hz`."""
        low, high = self.trusted_hz
        inside = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        return np.asarray(inside & (self.std_error <= TRUSTED * np.abs(self.response)))

    @property
    def trusted_hz(self) -> tuple[float, float]:
        """The widest range [Hz] whose lines have a relative standard error below a tenth; NaN without one.

        Narrow gaps, as an antiresonance makes, belong to it.
        """
        good = self.frequency_hz[self.std_error <= TRUSTED * np.abs(self.response)]
        if good.size == 0:
            return nan, nan
        cuts = np.flatnonzero(good[1:] > np.maximum(WIDEST_GAP * good[:-1], good[:-1] + 1.5))
        ranges = zip(np.r_[0, cuts + 1], np.r_[cuts, good.size - 1], strict=True)
        low, high = max(ranges, key=lambda one: good[one[1]] / good[one[0]])
        return float(good[low]), float(good[high])

    def within(self, chosen: NDArray[np.bool_]) -> "ResponseCurve":
        """The curve at some of its frequencies (k,)."""
        return replace(
            self,
            frequency_hz=self.frequency_hz[chosen],
            response=self.response[chosen],
            std_error=self.std_error[chosen],
            coherence=self.coherence[chosen],
        )


class Resonances(NamedTuple):
    """First antiresonance and first resonance [Hz] of a response; NaN where none stands out."""

    antiresonance_hz: float
    resonance_hz: float


def resonances(curve: ResponseCurve) -> Resonances:
    """Find them in the speed per torque: a dip and a peak that stand out by 3 dB and four standard errors."""
    if curve.frequency_hz.size < 3:
        return Resonances(nan, nan)
    level_db = 20.0 * np.log10(curve.frequency_hz * np.abs(curve.response))
    error_db = 20.0 / np.log(10.0) * float(np.median(curve.std_error / np.abs(curve.response)))
    prominence = max(PROMINENCE_DB, SURE * error_db)

    def first(values: FloatArray) -> float:
        at, _ = find_peaks(values, prominence=prominence)
        if at.size == 0:
            return nan
        around = slice(at[0] - 1, at[0] + 2)
        x = curve.frequency_hz[around]
        bend, slope, _ = np.polyfit(x - x[1], values[around], 2)
        return float(np.clip(x[1] - slope / (2.0 * bend), x[0], x[2]))

    return Resonances(first(-level_db), first(level_db))
