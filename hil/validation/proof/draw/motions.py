"""Draw motions: for training, another one to hold out, and poor ones with little excitation.

A good motion has the full travel, several feeds both ways, creep through reversals, standstill, short strokes and
accelerations. All are made of sine-squared moves (`hil.motion.profile`), from rest to rest.
"""

from typing import Any, Literal, get_args

from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan
from hil.validation.proof.draw.axes import JERK_M_S3, DrawnAxis
from hil.validation.proof.draw.axis_kinds import Rng, log_uniform

Runs = tuple[Trajectory, Trajectory, Trajectory]  # two for training, one to hold out
Poor = Literal["one_way", "local", "slow"]
POOR: tuple[Poor, ...] = get_args(Poor)
TRAINING_S, SHORT_S, HOLDOUT_S = 18.0, 12.0, 12.0
_CREEP_M_S = (0.6e-3, 12e-3)
_TRIES = 5  # draws that do not fit into the time before a motion counts as full


def good(rng: Rng, axis: DrawnAxis) -> Runs:
    """Draw a long and a short motion for training, and one with other feeds, strokes and positions to hold out."""
    return _good(rng, axis, TRAINING_S), _good(rng, axis, SHORT_S), _good(rng, axis, HOLDOUT_S)


def poor(rng: Rng, axis: DrawnAxis, kind: Poor) -> Runs:
    """Draw three motions with little excitation: one stroke in one direction, recorded until shortly before its end;
    strokes of about 1 mm in one place; or one low feed back and forth with low acceleration."""
    return _poor(rng, axis, kind), _poor(rng, axis, kind), _poor(rng, axis, kind)


def _poor(rng: Rng, axis: DrawnAxis, kind: Poor) -> Trajectory:
    if kind == "one_way":
        feed = axis.travel_m / rng.uniform(4.0, 8.0)
        whole = _planned(axis, [_rest(0.2), _to(axis.travel_m, feed)])
        return whole.first(round(0.95 * len(whole)))
    if kind == "local":
        stroke, feed = rng.uniform(0.5e-3, 2e-3), axis.feed_m_s * rng.uniform(0.02, 0.05)
        laps = [_stroke(stroke, feed), _rest(0.1), _stroke(-stroke, feed), _rest(0.1)]
        return _planned(axis, [_rest(0.2), *laps * 8])
    feed = axis.feed_m_s * rng.uniform(0.02, 0.05)
    laps = [_stroke(4.0 * feed, feed), _stroke(-4.0 * feed, feed)]
    return _planned(axis, [_rest(0.2), *laps, _rest(0.2)], gentle=0.1)


def _good(rng: Rng, axis: DrawnAxis, seconds: float) -> Trajectory:
    travel, fast = axis.travel_m, axis.feed_m_s
    groups = [
        [_to(travel * rng.uniform(0.9, 1.0), fast), _to(0.0, fast * rng.uniform(0.6, 1.0))],
        _creep(rng, _CREEP_M_S[0], 3e-3),
        _creep(rng, 3e-3, _CREEP_M_S[1]),
        _short_strokes(rng, axis),
        [_rest(rng.uniform(0.3, 0.6))],
    ]
    segments = [_rest(rng.uniform(0.15, 0.3))]
    for index in rng.permutation(len(groups)):
        segments += [*groups[index], _rest(rng.uniform(0.05, 0.15))]
    tries = 0
    while tries < _TRIES:
        feed = log_uniform(rng, 0.05, 1.0) * fast
        there = travel * rng.uniform(0.0, 1.0)
        more = [_to(there, feed)] if rng.random() < 0.6 else _creep(rng, *_CREEP_M_S)
        if rng.random() < 0.5:
            more = [*more, _rest(rng.uniform(0.05, 0.25))]
        longer = [*segments, *more, _rest(0.2)]
        if _seconds(axis, longer) < seconds:
            segments += more
        else:
            tries += 1
    return _planned(axis, [*segments, _rest(0.2)])


def _creep(rng: Rng, low_m_s: float, high_m_s: float) -> list[dict[str, Any]]:
    """Draw reversals at some mm/s, with or without a rest."""
    feed = log_uniform(rng, low_m_s, high_m_s)
    stroke = feed * rng.uniform(0.4, 0.8)
    if rng.random() < 0.5:
        return [{"kind": "reversal", "stroke_m": stroke, "feed_m_s": feed, "cycles": int(rng.integers(1, 3))}]
    return [_stroke(stroke, feed), _stroke(-stroke, feed)] * 2


def _short_strokes(rng: Rng, axis: DrawnAxis) -> list[dict[str, Any]]:
    """Draw strokes of two lengths there and back, without constant feed."""
    strokes = [log_uniform(rng, 1e-3, 30e-3) for _ in range(2)]
    return [_stroke(sign * stroke, axis.feed_m_s) for stroke in strokes for sign in (1, -1)]


def _stroke(stroke_m: float, feed_m_s: float) -> dict[str, Any]:
    return {"kind": "sine_squared", "stroke_m": stroke_m, "feed_m_s": feed_m_s}


def _to(position_m: float, feed_m_s: float) -> dict[str, Any]:
    return {"kind": "sine_squared", "to_m": position_m, "feed_m_s": feed_m_s}


def _rest(duration_s: float) -> dict[str, Any]:
    return {"kind": "dwell", "duration_s": duration_s}


def _profile(axis: DrawnAxis, segments: list[dict[str, Any]], gentle: float = 1.0) -> Profile:
    limits = {
        "velocity_m_s": axis.feed_m_s,
        "acceleration_m_s2": gentle * axis.acceleration_m_s2,
        "jerk_m_s3": gentle * JERK_M_S3,
    }
    return Profile.model_validate({"schema_version": 1, "limits": limits, "segments": segments})


def _seconds(axis: DrawnAxis, segments: list[dict[str, Any]]) -> float:
    profile = _profile(axis, segments)
    return sum(profile.slots(run.move) for run in profile.runs) * profile.grid_s


def _planned(axis: DrawnAxis, segments: list[dict[str, Any]], gentle: float = 1.0) -> Trajectory:
    return plan(_profile(axis, segments, gentle), axis.period_s)
