"""Frequency responses of an axis as data: curves, their trustworthy range, resonances, bandwidth."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from hil.arrays import FloatArray
from hil.frequency.margins import StabilityMargins

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
        arrays = (self.frequency_hz, self.response, self.std_error, self.coherence)
        return ResponseCurve(self.title, self.unit, *(one[chosen] for one in arrays), self.radius)


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


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Measured frequency responses of an axis beside those of its twin.

    `measured` and `twin` map the same names to a `ResponseCurve`: "plant_motor" (torque to motor position),
    "plant_table" (torque to table position, with a linear encoder), and with a known control law "velocity_open",
    "velocity_closed", "position_open", "position_closed" (position command to table position, without a linear encoder
    to motor position). `margins` and `twin_margins` have the open loops. `bandwidth_hz` and `twin_bandwidth_hz` are
    -3 dB of the closed loops. `method`: "periods" or "welch"; `averages` independent blocks, `resolution_hz` apart.
    `coherence` (k,) at `frequency_hz` (k,) is that of torque and motor with the set-points; `trusted_hz` the range in
    which the plant is known to a tenth. `distorted`: the axis stopped in the excitation, so that friction is in the
    responses beyond their errors. Printing it gives the table of `rows`; `plot` draws it.
    """

    name: str
    bench: str
    method: str
    averages: float
    resolution_hz: float
    measured: Mapping[str, ResponseCurve]
    twin: Mapping[str, ResponseCurve]
    margins: Mapping[str, StabilityMargins]
    twin_margins: Mapping[str, StabilityMargins]
    bandwidth_hz: Mapping[str, float]
    twin_bandwidth_hz: Mapping[str, float]
    resonances: Resonances
    twin_resonances: Resonances
    distorted: bool = False
    notes: tuple[str, ...] = ()

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies (k,) of the plant [Hz]."""
        return self.measured["plant_motor"].frequency_hz

    @property
    def coherence(self) -> FloatArray:
        """Coherence (k,) of torque and motor with the set-points, the smaller one."""
        return self.measured["plant_motor"].coherence

    @property
    def trusted_hz(self) -> tuple[float, float]:
        """Range [Hz] in which the response of the plant is known to a tenth."""
        return self.measured["plant_motor"].trusted_hz

    def __str__(self) -> str:
        from hil.frequency.table import as_text

        return as_text(self)

    __repr__ = __str__

    def plot(self) -> "Figure":
        """Draw magnitude and phase of plant and loops, measured with 95 % bounds over the twin, and the coherence."""
        from hil.frequency.picture import overview

        return overview(self)
