"""Lateness of a motion behind its set-points, at any ratio, beside lost motion and noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.identification.following import following

PERIOD_S = 1e-3
T = PERIOD_S * np.arange(8000)


def set_points(shift_s: float = 0.0) -> np.ndarray:
    t = T - shift_s
    return 0.1 * np.sin(2.0 * np.pi * 0.31 * t) + 0.03 * np.sin(2.0 * np.pi * 1.17 * t + 1.0)


@settings(max_examples=30, deadline=None)
@given(
    late_s=st.floats(2e-4, 0.03),
    early=st.booleans(),
    ratio=st.sampled_from([1.0, -0.0016, 0.2]),
    lost_m=st.sampled_from([0.0, 5e-6]),
)
def test_the_lateness_is_told_at_any_ratio(late_s: float, early: bool, ratio: float, lost_m: float) -> None:
    late_s = -late_s if early else late_s
    noise = np.random.default_rng(3).normal(0.0, 1e-6, T.size)
    lost = lost_m * np.sign(np.gradient(set_points()))
    found = following(set_points(), (set_points(late_s) + 0.4 - lost + noise) / ratio, PERIOD_S)
    assert found is not None
    assert found.late_s.value == pytest.approx(late_s, rel=0.03)
    assert ("early" if early else "late") in found.in_words("m")
    assert found.largest == pytest.approx(float(np.max(np.abs(set_points() - set_points(late_s)))), rel=0.2, abs=1e-5)


@pytest.mark.parametrize(("gain_1_s", "feedforward"), [(40.0, 0.0), (75.0, 0.9), (75.0, 1.1)])
def test_a_position_loop_is_late_by_what_its_feedforward_lacks_over_its_gain(
    gain_1_s: float, feedforward: float
) -> None:
    """x' = gain (s - x) + feedforward s', stepped as this file has it."""
    command = set_points()
    speed, position = np.gradient(command, PERIOD_S), np.empty(T.size)
    position[0] = command[0] - (1.0 - feedforward) / gain_1_s * speed[0]
    for row in range(1, T.size):
        moved = gain_1_s * (command[row - 1] - position[row - 1]) + feedforward * speed[row - 1]
        position[row] = position[row - 1] + PERIOD_S * moved
    found = following(command, position, PERIOD_S)
    assert found is not None
    assert found.late_s.value == pytest.approx((1.0 - feedforward) / gain_1_s, rel=0.05, abs=1e-4)


def test_without_lateness_or_motion_nothing_is_told() -> None:
    noise = np.random.default_rng(4).normal(0.0, 1e-5, T.size)
    assert following(set_points(), set_points() + noise, PERIOD_S) is None
    assert following(set_points(), np.zeros(T.size), PERIOD_S) is None
    assert following(np.zeros(T.size), set_points(), PERIOD_S) is None
