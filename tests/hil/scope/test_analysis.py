"""Spectrum and statistics against numbers worked out otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.scope.analysis import amplitude_spectrum, statistics

PERIOD_S = 1e-3


@given(st.integers(3, 400), st.floats(1e-6, 1e3), st.floats(-3.0, 3.0), st.floats(-10.0, 10.0))
def test_a_sine_of_whole_periods_has_its_amplitude_at_its_frequency(
    periods: int, amplitude: float, phase: float, mean: float
) -> None:
    time_s = np.arange(1000) * PERIOD_S
    values = amplitude * (mean + np.sin(2.0 * np.pi * periods * time_s + phase))
    frequencies, amplitudes = amplitude_spectrum(values, PERIOD_S, 2000)
    at = int(np.argmax(amplitudes))
    assert frequencies[at] == pytest.approx(periods)
    assert amplitudes[at] == pytest.approx(amplitude, rel=1e-9)


@given(st.integers(2, 3000), st.integers(1, 300))
def test_a_reduced_spectrum_keeps_its_highest_line(rows: int, points: int) -> None:
    values = np.random.default_rng(rows).normal(size=rows)
    _, every = amplitude_spectrum(values, PERIOD_S, 10**6)
    frequencies, amplitudes = amplitude_spectrum(values, PERIOD_S, points)
    assert len(amplitudes) <= points
    assert amplitudes.max() == every.max()
    assert np.all(np.diff(frequencies) > 0.0)


def test_statistics_of_numbers_worked_out_by_hand() -> None:
    told = statistics(np.array([3.0, -1.0, 1.0, 1.0]))
    assert told == {
        "mean": 1.0,
        "std": pytest.approx(2.0**0.5),
        "rms": pytest.approx(3.0**0.5),
        "min": -1.0,
        "max": 3.0,
        "span": 4.0,
        "first": 3.0,
        "last": 1.0,
    }
