"""One search for periods of a signal over a position, an angle or time that is sampled unevenly.

Candidates are peaks of the spectrum of the signal averaged in bins; the share of the energy that one harmonic explains
is that of the Lomb-Scargle periodogram with a free mean (M. Zechmeister, M. Kuerster, Astronomy and Astrophysics 496,
2009): least squares of sine, cosine and a constant over the rows themselves.
"""

import numpy as np

from hil.arrays import FloatArray
from hil.identification.least_squares import least_squares

_FEWEST_ROWS = 100
_MOST_BINS = 1 << 20  # a spindle turns millions of its shortest periods: memory and time stay bounded


def harmonic_share(phase: FloatArray, signal: FloatArray) -> float:
    """Share of the energy of a signal (n,) that one harmonic of a phase (n,) [rad] explains."""
    columns = {"sine": np.sin(phase), "cosine": np.cos(phase), "one": np.ones_like(phase)}
    return least_squares(columns, signal, blocks=0).share


def refined_period(position: FloatArray, signal: FloatArray, period: float, shortest: float, longest: float) -> float:
    """The period about one of `strongest_periods` at which a harmonic explains most of a signal (n,) over a position.

    Sought within half the width of its peak in the spectrum, and between the shortest and the longest period. What
    varies over more than the longest is taken off first.
    """
    from scipy.optimize import minimize_scalar  # a first look needs no optimiser

    span = float(np.ptp(position))
    width = 0.5 / span
    quick = signal - _slow(position, signal, longest) if longest < span else signal

    def left(frequency: float) -> float:
        return 1.0 - harmonic_share(2.0 * np.pi * frequency * position, quick)

    bounds = (max(1.0 / period - width, 1.0 / longest), min(1.0 / period + width, 1.0 / shortest))
    if not bounds[0] < bounds[1]:
        return period
    return float(1.0 / minimize_scalar(left, bounds=bounds, options={"xatol": 1e-3 * width}).x)


def strongest_periods(
    position: FloatArray, signal: FloatArray, width: float, shortest: float, most: int, longest: float = np.inf
) -> list[float]:
    """At most `most` periods of a signal (n,) over a position (n,), strongest first, in the unit of the position.

    The signal is averaged in bins of `width`, or wider ones over a long range. Periods lie between `shortest`, at least
    four bins, and `longest`, and 2.5 times the range. What varies over more than `longest` is taken off first: seen at
    uneven places, it has its share at every period.
    """
    span = float(np.ptp(position)) if position.size else 0.0
    width, shortest = max(width, span / _MOST_BINS), max(shortest, 4.0 * span / _MOST_BINS)
    if position.size < _FEWEST_ROWS or span < 4.0 * shortest or longest <= shortest:
        return []
    if longest < span:
        signal = signal - _slow(position, signal, longest)
    count = int(np.ceil(span / width))
    index = np.minimum(((position - position.min()) / span * count).astype(int), count - 1)
    rows = np.bincount(index, minlength=count)
    mean = np.bincount(index, weights=signal, minlength=count) / np.maximum(rows, 1)
    size = 4 * (1 << (count - 1).bit_length())  # zero-padded: a resolution of a quarter of a peak width
    spectrum = np.abs(np.fft.rfft(np.where(rows > 0, mean - mean[rows > 0].mean(), 0.0), size))
    frequency = np.fft.rfftfreq(size, span / count)
    apart = 2 * (size // count + 1)
    spectrum[(frequency > 1.0 / shortest) | (frequency < max(0.4 / span, 1.0 / longest))] = 0.0
    found = []
    for _ in range(most):
        peak = int(np.argmax(spectrum))
        if spectrum[peak] == 0.0:
            break
        found.append(float(1.0 / frequency[peak]))
        spectrum[max(peak - apart, 0) : peak + apart] = 0.0
    return found


def _slow(position: FloatArray, signal: FloatArray, width: float) -> FloatArray:
    """Means (n,) of a signal over positions in bins of a width, joined by straight lines."""
    index = ((position - position.min()) / width).astype(int)
    rows = np.bincount(index)
    where, mean = (np.bincount(index, weights=one)[rows > 0] / rows[rows > 0] for one in (position, signal))
    return np.asarray(np.interp(position, where, mean))
