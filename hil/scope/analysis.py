"""Values at two cursors, statistics between them, amplitude spectrum: of all rows, not of the points on the screen."""

from __future__ import annotations

import numpy as np

from hil.arrays import FloatArray


def statistics(values: FloatArray) -> dict[str, float]:
    """Mean, standard deviation, RMS, least, greatest, peak to peak, first and last value of rows (n,), n > 0."""
    least, greatest = float(values.min()), float(values.max())
    return {
        "mean": float(values.mean()),
        "std": float(values.std()),
        "rms": float(np.sqrt(np.mean(np.square(values)))),
        "min": least,
        "max": greatest,
        "span": greatest - least,
        "first": float(values[0]),
        "last": float(values[-1]),
    }


def amplitude_spectrum(values: FloatArray, period_s: float, points: int) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and peak amplitudes of the sines in rows (n,), mean removed, Hann window.

    A sine of whole periods has its amplitude at its frequency (Harris, Proc. IEEE 66 (1978) 51). More than `points`
    lines are reduced to the greatest of each stretch.
    """
    window = np.hanning(values.size + 1)[:-1]  # periodic
    amplitudes = 2.0 / window.sum() * np.abs(np.fft.rfft((values - values.mean()) * window))
    frequencies = np.fft.rfftfreq(values.size, period_s)
    step = -(-amplitudes.size // points)
    blocks = np.pad(amplitudes, (0, -amplitudes.size % step)).reshape(-1, step)
    at = blocks.argmax(axis=1) + np.arange(0, amplitudes.size, step)
    return frequencies[at], amplitudes[at]
