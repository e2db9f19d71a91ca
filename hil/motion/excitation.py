"""Chirp and multisine: position set-points for frequency responses, in closed form.

Both are x = Im z with complex z, so that derivatives are exact, times a window that rises and falls by a
polynomial with three continuous derivatives (the jerk starts and ends at zero). They may ride on a constant
feed, which keeps friction sliding.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from hil.arrays import FloatArray
from hil.errors import FieldError
from hil.motion.pieces import Array, Motion, MotionLimits, Move, Piece, Ramp
from hil.motion.sine_squared import ramp_duration_s

# 64 samples per shortest period miss a peak by at most 1 - cos(pi/64) = 0.12 %
SAMPLES_PER_PERIOD = 64
MISSED_PEAK = 1.0025


class Spectrum(StrEnum):
    """Quantity of constant amplitude over the band; the position amplitude falls with f to the power 0, 1, 2."""

    CONSTANT_DISPLACEMENT = "constant_displacement"
    CONSTANT_VELOCITY = "constant_velocity"
    CONSTANT_ACCELERATION = "constant_acceleration"

    @property
    def exponent(self) -> int:
        return list(Spectrum).index(self)


@dataclass(frozen=True)
class Chirp:
    """Exponential sweep x = (f/f0)^-n sin(phi), phi' = 2 pi f, f = f0 exp(k t) up to f1 at duration_s."""

    start_hz: float
    end_hz: float
    duration_s: float
    spectrum: Spectrum

    @property
    def highest_frequency_hz(self) -> float:
        return max(self.start_hz, self.end_hz)

    def derivatives(self, time_s: Array) -> list[Array]:
        """Return the signal and its first three derivatives at times (n,), in its own unit."""
        k = math.log(self.end_hz / self.start_hz) / self.duration_s
        low = min(self.start_hz, self.end_hz)  # amplitude 1 at the lowest frequency of the sweep
        omega = 2 * math.pi * self.start_hz * np.exp(k * time_s)
        phase = 2 * math.pi * self.start_hz * (np.expm1(k * time_s) / k if k else time_s)
        z = (omega / (2 * math.pi * low)) ** -self.spectrum.exponent * np.exp(1j * phase)
        # z' = q z with q = -n k + i omega, and q' = i k omega, q'' = i k^2 omega
        q, q1 = -self.spectrum.exponent * k + 1j * omega, 1j * k * omega
        factors = (1.0, q, q**2 + q1, q**3 + 3 * q * q1 + k * q1)
        return [np.imag(factor * z) for factor in factors]


@dataclass(frozen=True)
class Multisine:
    """Sum of equidistant lines between start_hz and end_hz with Schroeder phases, -pi i (i - 1)/N.

    The lines are the multiples of 1/lap_s, so that every lap repeats exactly (Schroeder, IEEE Trans. Inf.
    Theory 16, 1970: low crest factor; Pintelon, Schoukens: System Identification, ch. 5).
    """

    start_hz: float
    end_hz: float
    lap_s: float
    spectrum: Spectrum

    @cached_property
    def lines_hz(self) -> Array:
        first = math.ceil(self.start_hz * self.lap_s - 1e-9)
        return np.arange(first, math.floor(self.end_hz * self.lap_s + 1e-9) + 1) / self.lap_s

    @property
    def highest_frequency_hz(self) -> float:
        return float(self.lines_hz[-1])

    def derivatives(self, time_s: Array) -> list[Array]:
        count = len(self.lines_hz)
        result = [np.zeros_like(time_s) for _ in range(4)]
        for index, frequency in enumerate(self.lines_hz):
            omega = 2 * math.pi * frequency
            amplitude = (frequency / self.lines_hz[0]) ** -self.spectrum.exponent / count
            z = amplitude * np.exp(1j * (omega * time_s - math.pi * index * (index + 1) / count))
            for order in range(4):
                result[order] += np.imag((1j * omega) ** order * z)
        return result


Signal = Chirp | Multisine


@dataclass(frozen=True)
class Wave:
    """A windowed signal on a constant feed."""

    duration_s: float
    position_m: float
    feed_m_s: float
    scale_m: float  # metres per unit of the signal
    fade_s: float  # rise and fall of the window
    signal: Signal

    def at(self, time_s: Array) -> Motion:
        x, x1, x2, x3 = self.signal.derivatives(time_s)
        w, w1, w2, w3 = _window(time_s, self.duration_s, self.fade_s)
        return Motion(
            self.position_m + self.feed_m_s * time_s + self.scale_m * w * x,  # Leibniz' rule
            self.feed_m_s + self.scale_m * (w1 * x + w * x1),
            self.scale_m * (w2 * x + 2 * w1 * x1 + w * x2),
            self.scale_m * (w3 * x + 3 * w2 * x1 + 3 * w1 * x2 + w * x3),
        )


def excitation(
    start_m: float,
    signal: Signal,
    duration_s: float,
    fade_s: float,
    amplitude_m: float,
    feed_m_s: float,
    limits: MotionLimits,
) -> Move:
    """The signal, on the constant feed feed_m_s (0 for standstill), with ramps to it and from it.

    amplitude_m is the largest displacement. It is lowered where velocity, acceleration or jerk would pass a
    limit, and a note says so.
    """
    room_m_s = limits.velocity_m_s - abs(feed_m_s)
    if room_m_s <= 0:
        raise FieldError(
            ("base_feed_m_s",),
            f"given {feed_m_s:.6g}, allowed less than {limits.velocity_m_s:.6g} m/s in magnitude; lower the feed",
        )
    wave = Wave(duration_s, 0.0, 0.0, 1.0, fade_s, signal)
    samples = math.ceil(duration_s * signal.highest_frequency_hz * SAMPLES_PER_PERIOD) + 1
    motion = wave.at(np.linspace(0, duration_s, samples))
    largest_m, *peaks = (float(np.abs(values).max()) for values in motion)
    allowed = zip((room_m_s, limits.acceleration_m_s2, limits.jerk_m_s3), peaks, strict=True)
    allowed_m = largest_m * min(limit / (MISSED_PEAK * peak) for limit, peak in allowed)
    notes: tuple[str, ...] = ()
    if allowed_m < amplitude_m:
        notes = (
            f"amplitude lowered from {amplitude_m * 1e6:.4g} um to {allowed_m * 1e6:.4g} um "
            "to hold the limits of the profile",
        )
        amplitude_m = allowed_m

    ramp_s = ramp_duration_s(abs(feed_m_s), limits)
    wave_m = start_m + feed_m_s * ramp_s / 2
    wave = replace(wave, position_m=wave_m, feed_m_s=feed_m_s, scale_m=amplitude_m / largest_m)
    end_m = wave_m + feed_m_s * duration_s
    pieces: tuple[Piece, ...] = (wave,)
    if feed_m_s:
        pieces = (
            Ramp(ramp_s, start_m, 0.0, feed_m_s),
            wave,
            Ramp(ramp_s, end_m, feed_m_s, 0.0),
        )
    return Move(pieces, end_m + feed_m_s * ramp_s / 2, notes, signal.highest_frequency_hz)


def _window(time_s: Array, duration_s: float, fade_s: float) -> tuple[FloatArray, ...]:
    """w, w', w'', w''': 1 in the middle; s^4 (35 - 84 s + 70 s^2 - 20 s^3) over the fades, s from 0 to 1."""
    rising = time_s < duration_s / 2
    s = np.clip(np.where(rising, time_s, duration_s - time_s) / fade_s, 0.0, 1.0)
    sign = np.where(rising, 1.0, -1.0)
    return (
        s**4 * (35 + s * (-84 + s * (70 - 20 * s))),
        sign * 140 * s**3 * (1 - s) ** 3 / fade_s,
        420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / fade_s**2,
        sign * 840 * s * (1 - s) * (1 - 5 * s + 5 * s**2) / fade_s**3,
    )
