"""Margins against loops worked out by hand; resonances of a two-mass system in closed form; bounds of the estimator."""

from math import atan, degrees, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.bench.bench_file import load_bench
from hil.frequency.curves import ResponseCurve, resonances
from hil.frequency.joint import joint_estimate
from hil.frequency.margins import stability_margins
from hil.frequency.twin_curves import twin_curves

HZ = np.geomspace(0.01, 100.0, 20_000)
S = 2j * pi * HZ


def test_margins_of_three_lags() -> None:
    """L = 4 / (1 + s)^3: -180 deg at w = sqrt 3, where |L| = 4 / 8; |L| = 1 where (1 + w^2)^3 = 16."""
    found = stability_margins(HZ, 4.0 / (1.0 + S) ** 3)
    crossover = sqrt(16.0 ** (1 / 3) - 1.0)
    phase = pi - 3.0 * atan(crossover)
    assert found.gain_db == pytest.approx(20 * np.log10(2.0), abs=1e-4)
    assert found.gain_hz == pytest.approx(sqrt(3.0) / (2 * pi), rel=1e-4)
    assert found.crossover_hz == pytest.approx(crossover / (2 * pi), rel=1e-4)
    assert found.phase_deg == pytest.approx(degrees(phase), abs=1e-2)
    assert found.delay_s == pytest.approx(phase / crossover, rel=1e-3)
    assert np.isnan(found.gain_down_db)


def test_margins_of_an_integrator_with_a_delay() -> None:
    """L = k e^(-s T) / s: |L| = 1 at w = k, -180 deg at w = pi / 2 T, delay margin pi / 2 k - T."""
    k, late = 10.0, 0.05
    found = stability_margins(HZ, k * np.exp(-S * late) / S)
    assert found.delay_s == pytest.approx(pi / (2 * k) - late, rel=1e-4)
    assert found.gain_db == pytest.approx(20 * np.log10(pi / (2 * late * k)), abs=1e-3)
    assert found.phase_deg == pytest.approx(90.0 - degrees(k * late), abs=1e-2)


def test_a_conditionally_stable_loop_may_not_lose_gain() -> None:
    """L = 20 (1 + s)^2 / s^3: Im L = 0 at w = 1, where |L| = 40; there the gain may fall by 40 and rise for ever."""
    found = stability_margins(HZ, 20.0 * (1.0 + S) ** 2 / S**3)
    assert found.gain_down_db == pytest.approx(20 * np.log10(40.0), abs=1e-3)
    assert np.isnan(found.gain_db)


def test_the_modulus_margin_is_the_distance_to_the_critical_point() -> None:
    """L = k / s with P control lies on the imaginary axis: the nearest it comes to -1 is 1, at high frequency."""
    found = stability_margins(HZ, 1.0 / S)
    assert found.modulus == pytest.approx(1.0, abs=1e-4)
    assert found.phase_deg == pytest.approx(90.0)


def test_a_loop_of_one_frequency_is_refused() -> None:
    with pytest.raises(ValueError, match="two or more"):
        stability_margins(HZ[:1], 1.0 / S[:1])


def test_the_twin_has_the_resonances_of_two_masses() -> None:
    """Antiresonance sqrt(k / m2), resonance sqrt(k / m1 + k / m2), and at low frequency 1 / (s (J s + d))."""
    bench = load_bench("reference")
    curve = twin_curves(bench)["plant_motor"]
    found = resonances(curve)
    assert found.antiresonance_hz == pytest.approx(sqrt(5.64e7 / 384.0) / (2 * pi), rel=2e-3)
    assert found.resonance_hz == pytest.approx(sqrt(5.64e7 / 384.0 + 5.64e7 / 335.0) / (2 * pi), rel=2e-3)
    s, inertia = 2j * pi * curve.frequency_hz[0], (335.0 + 384.0) * (0.01 / (2 * pi)) ** 2
    assert curve.response[0] == pytest.approx(1.0 / (s * (inertia * s + 0.0064)), rel=1e-3)


def noisy(seed: int, blocks: int, lines: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Spectra of a reference and of two channels that answer to it, with correlated noise; and the answers."""
    random = np.random.default_rng(seed)
    answer = np.array([2.0 - 1.0j, 0.5 + 0.3j])[:, None] * np.ones(lines)
    reference = np.ones((blocks, lines), dtype=complex)
    noise = (random.normal(size=(blocks, 2, lines)) + 1j * random.normal(size=(blocks, 2, lines))) * 0.02
    noise[:, 1] -= 0.6 * noise[:, 0]  # as the feedback of a loop makes it
    return reference, answer * reference[:, None, :] + noise, answer


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 30))
def test_the_bound_holds_the_true_response_with_95_percent(seed: int, blocks: int) -> None:
    reference, channels, answer = noisy(seed, blocks, 2000)
    found = joint_estimate(reference, channels)
    response, error = found.quotient(0, 1)
    inside = np.abs(response - answer[0] / answer[1]) <= found.radius * error
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.complex_numbers(min_magnitude=0.1, max_magnitude=10.0))
def test_the_plant_does_not_depend_on_the_unit_of_the_reference(seed: int, factor: complex) -> None:
    reference, channels, _ = noisy(seed, 6, 20)
    for one, other in zip(
        joint_estimate(reference, channels).quotient(0, 1),
        joint_estimate(factor * reference, channels).quotient(0, 1),
        strict=True,
    ):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_noise_alone_has_no_coherence_and_two_blocks_are_needed() -> None:
    reference, channels, answer = noisy(1, 200, 50)
    assert joint_estimate(reference, channels - answer).coherence.max() < 0.1
    with pytest.raises(ValueError, match="2 or more"):
        joint_estimate(reference[:1], channels[:1])


def test_the_trusted_range_spans_narrow_gaps_only() -> None:
    hz = np.arange(1.0, 101.0)
    error = np.full(hz.size, 0.01)
    error[[39, 40]] = 1.0  # 40 and 41 Hz: an antiresonance
    error[70:90] = 1.0
    ones = np.ones(hz.size)
    curve = ResponseCurve("", "1", hz, ones.astype(complex), error, ones)
    assert curve.trusted_hz == (1.0, 70.0)
    assert np.count_nonzero(curve.trusted) == 68
