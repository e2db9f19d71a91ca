"""The sine-squared ramp against its definition and against the convolution it comes from."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from hil.errors import FieldError
from hil.motion.excitation import Chirp, Multisine, Spectrum, Wave
from hil.motion.pieces import MotionLimits, Ramp
from hil.motion.sine_squared import bell_duration_s, ramp_duration_s, reversals, sine_squared

LIMITS = MotionLimits(0.3, 2.0, 50.0)


def test_a_ramp_is_the_square_of_a_sine() -> None:
    t = np.linspace(0, 0.2, 101)
    ramp = Ramp(0.2, 0.0, 0.0, 0.3).at(t)
    assert ramp.velocity_m_s == pytest.approx(0.3 * np.sin(np.pi * t / 0.4) ** 2, abs=1e-15)
    assert ramp.acceleration_m_s2.max() == pytest.approx(math.pi * 0.3 / (2 * 0.2))
    assert ramp.jerk_m_s3[0] == pytest.approx(math.pi**2 * 0.3 / (2 * 0.2**2))


def test_a_rectangle_convolved_with_a_half_sine_is_the_same_move() -> None:
    move = sine_squared(0.0, 0.2, LIMITS)
    ramp_s, constant_s = move.pieces[0].duration_s, move.pieces[1].duration_s
    step = 5e-5
    rectangle = np.full(round((ramp_s + constant_s) / step), LIMITS.velocity_m_s)
    kernel_t = (np.arange(round(ramp_s / step)) + 0.5) * step
    kernel = np.pi / (2 * ramp_s) * np.sin(np.pi * kernel_t / ramp_s) * step
    convolved = np.convolve(rectangle, kernel)
    t, begin, expected = np.arange(1, len(convolved) + 1) * step, 0.0, []
    for piece in move.pieces:
        inside = (t > begin) & (t <= begin + piece.duration_s)
        expected.append(piece.at(t[inside] - begin).velocity_m_s)
        begin += piece.duration_s
    velocity = np.concatenate(expected)
    assert convolved[: len(velocity)] == pytest.approx(velocity, abs=1e-3 * LIMITS.velocity_m_s)


@pytest.mark.parametrize(
    ("limits", "peak"),
    [
        (MotionLimits(10.0, 2.0, 1e9), 2),  # acceleration decides
        (MotionLimits(10.0, 1e9, 50.0), 3),  # jerk decides
    ],
)
def test_the_shortest_bell_reaches_exactly_one_limit(limits: MotionLimits, peak: int) -> None:
    move = sine_squared(0.0, 0.1, limits)
    assert move.duration_s == pytest.approx(bell_duration_s(0.1, limits), rel=1e-14)
    motion = move.pieces[0].at(np.linspace(0, move.pieces[0].duration_s, 1001))
    assert np.abs(motion[peak]).max() == pytest.approx((10.0, 2.0, 50.0)[peak - 1], rel=1e-12)
    assert motion.velocity_m_s[-1] == pytest.approx(2 * 0.1 / move.duration_s, rel=1e-12)
    assert "feed lowered from 10 m/s (600 m/min)" in move.notes[0]


def test_the_feed_is_reached_when_the_stroke_is_just_long_enough() -> None:
    length = 0.3 * ramp_duration_s(0.3, LIMITS)
    assert sine_squared(0.0, length * (1 + 1e-6), LIMITS).notes == ()
    short = sine_squared(0.0, length * (1 - 1e-6), LIMITS)
    assert len(short.notes) == 1
    assert short.pieces[0].at(np.array([short.pieces[0].duration_s])).velocity_m_s[0] == pytest.approx(0.3, rel=1e-5)


def test_too_fast_a_reversal_is_refused() -> None:
    with pytest.raises(FieldError, match=r"feed_m_s: given 0.3 m/s \(18 m/min\), allowed a feed that the limits"):
        reversals(0.0, 0.001, 2, LIMITS)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_limits_must_be_positive(bad: float) -> None:
    with pytest.raises(FieldError, match=r"jerk_m_s3: given .* allowed a positive number"):
        MotionLimits(1.0, 1.0, bad)


@pytest.mark.parametrize("spectrum", Spectrum)
@pytest.mark.parametrize("sweep", [True, False])
def test_derivatives_of_excitations_agree_with_differences(spectrum: Spectrum, sweep: bool) -> None:
    signal = Chirp(1.0, 20.0, 4.0, spectrum) if sweep else Multisine(1.0, 20.0, 2.0, spectrum)
    t = np.linspace(0, 4.0, 400_001)
    motion = Wave(4.0, 0.1, 0.02, 1e-3, 0.5, signal).at(t)
    for value, derivative in pairwise(motion):
        difference = np.gradient(value, t)[2:-2]
        assert np.abs(difference - derivative[2:-2]).max() <= 2e-5 * np.abs(derivative).max()


def test_a_multisine_has_its_lines_and_no_others_and_repeats() -> None:
    signal = Multisine(2.0, 10.0, 2.0, Spectrum.CONSTANT_VELOCITY)
    t = np.arange(4000) / 1000
    x = signal.derivatives(t)[0]
    assert x[:2000] == pytest.approx(x[2000:], abs=1e-12)
    lines = np.abs(np.fft.rfft(x[:2000])) / 1000
    index = np.arange(4, 21)
    assert np.nonzero(lines > 1e-9)[0].tolist() == index.tolist()
    assert lines[index] * index == pytest.approx(lines[4] * 4)  # equal velocity on every line
