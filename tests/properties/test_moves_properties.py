"""Random moves and states: limits, end positions, and ruckig's time-optimal bound."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from hil.errors import FieldError
from hil.motion.excitation import Chirp, Multisine, Spectrum, excitation
from hil.motion.pieces import Motion, MotionLimits, Piece
from hil.motion.sine_squared import reversals, sine_squared
from hil.motion.time_optimal import MotionState, point_to_point, stop

TOLERANCE = 1e-9

limits_of = st.builds(MotionLimits, st.floats(1e-4, 5), st.floats(1e-2, 50), st.floats(1, 1e4))
position = st.floats(-1, 1)
stroke = st.floats(1e-6, 2).flatmap(lambda length: st.sampled_from([length, -length]))


def sampled(pieces: Iterable[Piece], count: int = 33) -> list[Motion]:
    return [piece.at(np.linspace(0.0, piece.duration_s, count)) for piece in pieces]


def assert_smooth(motions: list[Motion], start: MotionState) -> MotionState:
    """Position, velocity and acceleration go on from piece to piece; returns the state at the end."""
    state = start
    for motion in motions:
        first = MotionState(*(float(values[0]) for values in motion[:3]))
        assert first == pytest.approx(state, rel=1e-9, abs=1e-9)
        state = MotionState(*(float(values[-1]) for values in motion[:3]))
    return state


def assert_within(motions: list[Motion], limits: MotionLimits) -> None:
    for motion in motions:
        assert np.abs(motion.velocity_m_s).max() <= limits.velocity_m_s * (1 + TOLERANCE)
        assert np.abs(motion.acceleration_m_s2).max() <= limits.acceleration_m_s2 * (1 + TOLERANCE)
        assert np.abs(motion.jerk_m_s3).max() <= limits.jerk_m_s3 * (1 + TOLERANCE)


def check_move(start_m: float, stroke_m: float, limits: MotionLimits) -> None:
    move = sine_squared(start_m, start_m + stroke_m, limits)
    motions = sampled(move.pieces)
    assert_within(motions, limits)
    end = assert_smooth(motions, MotionState(start_m))
    assert abs(end.position_m - (start_m + stroke_m)) <= TOLERANCE
    assert end[1:] == pytest.approx((0, 0), abs=1e-12 * limits.acceleration_m_s2)
    # the shape keeps one direction, so that it never leaves the stroke
    assert all((motion.velocity_m_s * np.sign(stroke_m) >= 0).all() for motion in motions)
    assert move.duration_s >= point_to_point(0.0, stroke_m, limits).duration_s * (1 - TOLERANCE)
    # limits are used: one of feed, acceleration, jerk is reached
    used = [max(float(np.abs(motion[order]).max()) for motion in motions) for order in (1, 2, 3)]
    allowed = (limits.velocity_m_s, limits.acceleration_m_s2, limits.jerk_m_s3)
    assert max(u / a for u, a in zip(used, allowed, strict=True)) == pytest.approx(1, abs=1e-9)


@pytest.mark.long
def test_ten_thousand_random_moves_hold_limits_and_end_where_they_should() -> None:
    rng = np.random.default_rng(20)
    for _ in range(10_000):
        limits = MotionLimits(*(10.0 ** rng.uniform([-4, -2, 0], [0.5, 1.5, 4])))
        check_move(rng.uniform(-1, 1), rng.choice([-1, 1]) * 10 ** rng.uniform(-6, 0.7), limits)


@given(position, stroke, limits_of)
def test_sine_squared_moves(start_m: float, stroke_m: float, limits: MotionLimits) -> None:
    check_move(start_m, stroke_m, limits)


@given(position, stroke, st.integers(1, 5), limits_of)
def test_reversals_turn_at_both_ends_and_come_back(
    start_m: float, stroke_m: float, cycles: int, limits: MotionLimits
) -> None:
    try:
        move = reversals(start_m, stroke_m, cycles, limits)
    except FieldError:  # too fast to turn within the stroke
        reject()
    motions = sampled(move.pieces)
    assert_within(motions, limits)
    assert assert_smooth(motions, MotionState(start_m)).position_m == pytest.approx(start_m, abs=TOLERANCE)
    positions = np.concatenate([motion.position_m for motion in motions])
    ends = sorted((start_m, start_m + stroke_m))
    assert (positions.min(), positions.max()) == pytest.approx(ends, abs=TOLERANCE)


def check_stop(state: MotionState, limits: MotionLimits) -> None:
    # what cannot be helped: the acceleration is brought to zero at full jerk, and the velocity goes on meanwhile
    carried = state.velocity_m_s + state.acceleration_m_s2 * abs(state.acceleration_m_s2) / (2 * limits.jerk_m_s3)
    reach = MotionLimits(
        max(limits.velocity_m_s, abs(state.velocity_m_s), abs(carried)),
        max(limits.acceleration_m_s2, abs(state.acceleration_m_s2)),
        limits.jerk_m_s3,
    )
    move = stop(state, limits)
    motions = sampled(move.pieces, 17)
    assert_within(motions, reach)
    end = assert_smooth(motions, state)
    assert end == pytest.approx((move.end_m, 0, 0), abs=TOLERANCE)


def check_approach(start_m: float, target_m: float, limits: MotionLimits) -> None:
    motions = sampled(point_to_point(start_m, target_m, limits).pieces, 17)
    assert_within(motions, limits)
    assert assert_smooth(motions, MotionState(start_m)) == pytest.approx((target_m, 0, 0), abs=TOLERANCE)


def test_three_thousand_random_states_stop_and_positions_are_approached() -> None:
    rng = np.random.default_rng(21)
    for _ in range(3000):
        limits = MotionLimits(*(10.0 ** rng.uniform([-3, -1, 0.5], [0.5, 1.5, 4])))
        state = MotionState(
            rng.uniform(-1, 1), limits.velocity_m_s * rng.uniform(-2, 2), limits.acceleration_m_s2 * rng.uniform(-2, 2)
        )
        check_stop(state, limits)
        check_approach(state.position_m, rng.uniform(-1, 1), limits)


@given(st.builds(MotionState, position, st.floats(-3, 3), st.floats(-30, 30)), position, limits_of)
def test_any_state_stops_and_any_target_is_approached(
    state: MotionState, target_m: float, limits: MotionLimits
) -> None:
    check_stop(state, limits)
    check_approach(state.position_m, target_m, limits)


@given(
    st.sampled_from(Spectrum),
    st.booleans(),
    st.floats(0.5, 5),
    st.floats(6, 40),
    st.floats(1e-5, 1e-2),
    st.just(0.0) | st.floats(1e-6, 0.05) | st.floats(-0.05, -1e-6),
)
@settings(max_examples=40)
def test_excitations_hold_limits_between_the_samples_too(
    spectrum: Spectrum, sweep: bool, start_hz: float, end_hz: float, amplitude_m: float, feed: float
) -> None:
    limits = MotionLimits(0.2, 2.0, 500.0)
    signal = Chirp(start_hz, end_hz, 4.0, spectrum) if sweep else Multisine(start_hz, end_hz, 2.0, spectrum)
    move = excitation(0.1, signal, 4.0, 0.5, amplitude_m, feed, limits)
    motions = sampled(move.pieces, 40_001)
    assert_within(motions, limits)
    assert assert_smooth(motions, MotionState(0.1)) == pytest.approx((move.end_m, 0, 0), abs=TOLERANCE)
    wave = motions[len(motions) // 2]
    base = wave.position_m[0] + feed * np.linspace(0, 4.0, 40_001)
    assert np.abs(wave.position_m - base).max() <= amplitude_m * 1.003
    assert move.notes or np.abs(wave.position_m - base).max() == pytest.approx(amplitude_m, rel=0.003)
