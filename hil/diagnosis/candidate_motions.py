"""Candidate motions of an experiment.

They stay within travel, velocity, acceleration and jerk of the recorded set-points or of the bench file.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.measured import Measured
from hil.motion.pieces import MotionLimits
from hil.motion.profile import Profile
from hil.motion.sine_squared import ramp_duration_s

_WINDOW_S = 0.01  # window of the mean acceleration and jerk of recorded set-points; a mean never exceeds the peak
_STRETCH_S = 0.5  # duration of constant feed, if the travel allows it: several settling times of a position loop
_SHORT_S = 9.0  # shorter motions are repeated: a held-out third then lasts 3 s
_LONG_S = 60.0  # duration of a motion for slow changes, such as friction drift
_LONGEST_S = 120.0  # limit of the duration of an experiment
_CREEP_M_S = (0.001, 0.004, 0.015)  # within and above the falling part of the friction curve

Segments = list[dict[str, Any]]


@dataclass(frozen=True)
class Reach:
    """Travel [m] and limits that are known to be safe, and where the recorded set-points started [m]."""

    low_m: float
    high_m: float
    start_m: float
    velocity_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float


def reach(runs: Sequence[Measured], bench: Bench) -> Reach:
    """Range of the recorded set-points, or of the bench file if it is given there.

    The travel of the bench file is reduced by its largest following error.
    """
    low = min(float(run.position_command_m.min()) for run in runs)
    high = max(float(run.position_command_m.max()) for run in runs)
    drive = bench.drive
    if drive is not None and drive.travel_m is not None:
        margin = drive.following_error_m
        low, high = min(low, drive.travel_m[0] + margin), max(high, drive.travel_m[1] - margin)
    acceleration = [_slope(run.velocity_command_m_s, run.period_s) for run in runs]
    jerk = [_slope(values, run.period_s) for values, run in zip(acceleration, runs, strict=True)]
    peaks = [
        max(float(np.max(np.abs(values))) for values in channel)
        for channel in ([run.velocity_command_m_s for run in runs], acceleration, jerk)
    ]
    if drive is not None and drive.limits is not None:
        peaks = list(drive.limits.model_dump().values())
    low, high = math.ceil(1e6 * low) / 1e6, math.floor(1e6 * high) / 1e6
    return Reach(low, high, min(max(round(float(runs[0].position_command_m[0]), 6), low), high), *map(_down, peaks))


def candidates(found: Reach) -> tuple[list[Profile], list[Profile]]:
    """Candidate motions within a reach: those of up to 15 s, and longer ones.

    Motions beyond what a profile may hold are left out, such as those of a load that turns many times. Both are empty
    if the recordings have no acceleration (parts of a constant feed).
    """
    if not min(found.velocity_m_s, found.acceleration_m_s2, found.jerk_m_s3) > 0.0:
        return [], []
    top, room = found.velocity_m_s, max(found.high_m - found.start_m, found.start_m - found.low_m)
    way = 1.0 if found.high_m - found.start_m >= found.start_m - found.low_m else -1.0  # to the longer travel
    creep = [part for feed in _CREEP_M_S for part in _reversal(found, way * room, feed)]
    turns = [part for share in (0.1, 0.4) for part in _reversal(found, way * room, _down(share * top))]
    feeds = [part for share in (1.0, 0.5, 0.25, 0.1) for part in _feed(found, way * room, _down(share * top))]
    strokes = [
        part
        for share in (0.02, 0.05, 0.1)
        for _ in range(2)
        for part in _there_and_back(way * _down(share * room), top, rest_s=0.05)
    ]
    ramps = [
        part
        for share in (1.0, 0.5, 0.2)
        for part in _there_and_back(
            way * room, _down(0.7 * top), acceleration_m_s2=_down(share * found.acceleration_m_s2)
        )
    ]
    travel = [
        part
        for feed in (top, _down(0.3 * top))
        for position in (found.high_m, found.low_m, found.start_m)
        for part in ({"kind": "sine_squared", "to_m": position, "feed_m_s": feed}, _rest())
    ]
    rests = [
        part
        for rest_s in (0.5, 1.0, 2.0)
        for part in (*_there_and_back(way * _down(0.02 * room), _down(0.1 * top)), _rest(rest_s))
    ]
    motions = {
        "creep through reversals": creep,
        "turning at low feeds": turns,
        "several feeds both ways": feeds,
        "short strokes near the limits": strokes,
        "several accelerations": ramps,
        "the whole travel both ways": travel,
        "short moves between rests": rests,
        "creep, feeds, strokes and the whole travel": [*creep, *feeds, *strokes, *travel],
    }
    wanted = [(what, segments, _SHORT_S) for what, segments in motions.items() if segments]
    wanted.append(("several feeds both ways, for a minute", feeds, _LONG_S))
    made = [profile for one in wanted if (profile := _repeated(found, *one)) is not None]
    durations_s = list(map(_duration_s, made))
    return (
        [profile for profile, time_s in zip(made, durations_s, strict=True) if time_s <= _LONG_S / 4],
        [profile for profile, time_s in zip(made, durations_s, strict=True) if _LONG_S / 4 < time_s <= _LONGEST_S],
    )


def _repeated(found: Reach, description: str, segments: Segments, least_s: float) -> Profile | None:
    """Profile of the segments, repeated to last at least `least_s`; None if they are beyond what a profile may hold."""
    limits = {
        "velocity_m_s": found.velocity_m_s,
        "acceleration_m_s2": found.acceleration_m_s2,
        "jerk_m_s3": found.jerk_m_s3,
    }

    def profile(times: int) -> Profile:
        return Profile.model_validate(
            {
                "schema_version": 1,
                "description": description,
                "limits": limits,
                "start_m": found.start_m,
                "segments": [_rest(), {"kind": "repeat", "times": times, "segments": segments}],
            }
        )

    try:
        return profile(math.ceil(least_s / _duration_s(profile(1))))
    except ValidationError:
        return None


def _reversal(found: Reach, way_m: float, feed_m_s: float) -> Segments:
    """Triangles with stretches of constant feed; empty if the feed or the travel does not allow them."""
    stroke_m = _stroke_m(found, feed_m_s, 2.0 * feed_m_s)
    if feed_m_s > found.velocity_m_s or stroke_m > abs(way_m):
        return []
    stroke_m = math.copysign(stroke_m, way_m)
    return [{"kind": "reversal", "stroke_m": stroke_m, "feed_m_s": feed_m_s, "cycles": 2}, _rest()]


def _feed(found: Reach, way_m: float, feed_m_s: float) -> Segments:
    stroke_m = min(_stroke_m(found, feed_m_s, feed_m_s), abs(way_m))
    return _there_and_back(math.copysign(stroke_m, way_m), feed_m_s)


def _stroke_m(found: Reach, feed_m_s: float, step_m_s: float) -> float:
    """Stroke of a stretch at constant feed and of the ramps over a step of velocity."""
    limits = MotionLimits(found.velocity_m_s, found.acceleration_m_s2, found.jerk_m_s3)
    return _down(feed_m_s * (_STRETCH_S + ramp_duration_s(step_m_s, limits)))


def _there_and_back(stroke_m: float, feed_m_s: float, rest_s: float = 0.2, **limits: float) -> Segments:
    return [
        part
        for stroke in (stroke_m, -stroke_m)
        for part in ({"kind": "sine_squared", "stroke_m": stroke, "feed_m_s": feed_m_s, **limits}, _rest(rest_s))
    ]


def _rest(duration_s: float = 0.2) -> dict[str, Any]:
    return {"kind": "dwell", "duration_s": duration_s}


def _duration_s(profile: Profile) -> float:
    return sum(run.move.duration_s for run in profile.runs)


def _slope(values: FloatArray, period_s: float) -> FloatArray:
    """Mean slope over the window (n,)."""
    rows = max(round(_WINDOW_S / period_s), 1)
    return (values[rows:] - values[:-rows]) / (rows * period_s)


def _down(value: float) -> float:
    """SearchRound down to four digits."""
    if value <= 0.0:
        return value
    factor = 10.0 ** (3 - math.floor(math.log10(value)))
    return math.floor(value * factor) / factor
