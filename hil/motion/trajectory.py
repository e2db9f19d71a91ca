"""Trajectories: the set-points of every tick, computed before the motion starts.

Moves of a profile have sine-squared velocity ramps, as the path generator of the source (`hil.motion.sine_squared`).
Approach, jog and stops are time-optimal (`hil.motion.time_optimal`). Both are evaluated in closed form;
no derivative is numerical.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.errors import FieldError, InputError, field_name
from hil.figures.panels import COMMAND, Line, Panel
from hil.motion.pieces import MAX_DURATION_S, Array, Cubic, Motion, MotionLimits, Move
from hil.motion.time_optimal import MotionState, point_to_point, stop

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing
    from hil.motion.profile import Profile

APPROACH = "approach to start"
MAX_POSITION_M = 100.0  # as in a profile
MAX_SET_POINTS = 2e7  # five hours at 1 ms; their arrays take 1 GB
SAMPLES_PER_PERIOD_MIN = 4  # of an excitation; fewer are no sine any more


class SegmentRun(NamedTuple):
    """An executed segment: its place in the profile, the number of its earlier executions, begin and end [s]."""

    name: str
    kind: str
    lap: int
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Trajectory:
    """Set-points at t = k period_s; arrays of one length, read-only.

    `segment` indexes `runs`. The last sample is at rest. `notes` say what was changed to hold the limits.
    """

    period_s: float
    time_s: Array
    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array
    jerk_m_s3: Array
    segment: NDArray[np.int32]
    runs: tuple[SegmentRun, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        peaks = (self.velocity_m_s, self.acceleration_m_s2, self.jerk_m_s3)
        velocity, acceleration, jerk = (float(np.max(np.abs(values))) for values in peaks)
        lines = [
            f"Trajectory: {len(self)} set-points at {1e3 * self.period_s:g} ms = {self.duration_s:.3f} s, "
            f"{len(self.runs)} segments",
            f"  position {1e3 * self.position_m.min():.3f} to {1e3 * self.position_m.max():.3f} mm; largest velocity "
            f"{velocity:.4g} m/s, acceleration {acceleration:.4g} m/s^2, jerk {jerk:.4g} m/s^3",
        ]
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    @property
    def duration_s(self) -> float:
        return float(self.time_s[-1])

    def first(self, rows: int) -> Trajectory:
        """Return the first rows."""
        arrays: dict[str, Any] = {
            name: value[:rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **arrays)

    def plot(self) -> Drawing:
        """Draw position, velocity, acceleration and jerk over time; returns a matplotlib Figure."""
        from hil.figures.drawing import over_time

        panels = [
            Panel(label, unit, (Line("set-points", values, COMMAND),))
            for label, unit, values in (
                ("position", "m", self.position_m),
                ("velocity", "m/s", self.velocity_m_s),
                ("acceleration", "m/s^2", self.acceleration_m_s2),
                ("jerk", "m/s^3", self.jerk_m_s3),
            )
        ]
        return over_time(f"Set-points, {self.duration_s:.1f} s", self.time_s, panels)


def plan(profile: Profile, period_s: float, start_m: float | None = None) -> Trajectory:
    """Compute the set-points of a profile, one per period_s [s] (`bench.period_s`).

    start_m: present position of the axis [m]; if it is not profile.start_m, a time-optimal approach comes first.
    Each segment begins at a multiple of profile.grid_s after the approach.

    Raises FieldError (an InputError): a period that is not positive or gives too many set-points, a start
    beyond +-100 m or outside the travel, an excitation
    too fast for the period.
    """
    _check_period(period_s)
    if start_m is not None and abs(start_m) > MAX_POSITION_M:
        raise FieldError(("start_m",), f"given {start_m}, allowed -{MAX_POSITION_M:g} to {MAX_POSITION_M:g} m")
    timed: list[tuple[float, str, str, int, Move]] = []
    notes: list[str] = []
    slot = 0
    if start_m is not None and start_m != profile.start_m:
        approach = point_to_point(start_m, profile.start_m, profile.motion_limits)
        profile.check_position(("start_m",), min(start_m, profile.start_m), max(start_m, profile.start_m))
        timed.append((0.0, APPROACH, "approach", 0, approach))
        slot = profile.slots(approach)
    for run in profile.runs:
        if run.move.highest_frequency_hz * period_s * SAMPLES_PER_PERIOD_MIN > 1:
            raise FieldError(
                run.field,
                f"given {run.move.highest_frequency_hz:.6g} Hz at a control period of "
                f"{period_s:.6g} s, allowed up to {1 / (SAMPLES_PER_PERIOD_MIN * period_s):.6g} Hz; "
                "lower the band",
            )
        name = field_name(run.field)
        timed.append((slot * profile.grid_s, name, run.kind, run.lap, run.move))
        slot += profile.slots(run.move)
        notes += [f"{name}: {note}" for note in run.move.notes if run.lap == 0]
    ends = [start for start, *_ in timed[1:]] + [slot * profile.grid_s]
    runs = tuple(
        SegmentRun(name, kind, lap, start, end) for (start, name, kind, lap, _), end in zip(timed, ends, strict=True)
    )
    return _sampled([move for *_, move in timed], runs, period_s, tuple(notes))


def stop_from(
    position_m: float, velocity_m_s: float, acceleration_m_s2: float, limits: MotionLimits, period_s: float
) -> Trajectory:
    """Time-optimal stop from any state; ends wherever that is.

    A velocity or acceleration beyond its limit is brought back in the shortest time. Raises InputError for
    values that are not finite and for a state so far beyond the limits that it takes more than an hour.
    """
    _check_period(period_s)
    state = MotionState(position_m, velocity_m_s, acceleration_m_s2)
    move = stop(state, limits)
    if move.duration_s > MAX_DURATION_S:
        raise InputError(
            f"stop: given {state}, from which it takes {move.duration_s:.6g} s within {limits}, "
            f"allowed up to {MAX_DURATION_S:.0f} s; raise the limits"
        )
    run = SegmentRun("stop", "stop", 0, 0.0, move.duration_s)
    return _sampled([move], (run,), period_s, move.notes)


def _sampled(
    moves: Sequence[Move], runs: tuple[SegmentRun, ...], period_s: float, notes: tuple[str, ...]
) -> Trajectory:
    """Every piece evaluated at the ticks that fall into it; rest after a move until the next one starts."""
    if runs[-1].end_s > MAX_SET_POINTS * period_s:
        raise FieldError(("period_s",), f"given {period_s:g} s for {runs[-1].end_s:g} s of motion, allowed up to "
                                        f"{MAX_SET_POINTS:g} set-points; lengthen the period")  # fmt: skip
    count = _first_tick(runs[-1].end_s / period_s) + 1
    time_s: Array = np.arange(count, dtype=np.float64) * period_s
    motion = Motion(*(np.zeros(count) for _ in range(4)))
    segment = np.zeros(count, np.int32)
    for index, (move, run) in enumerate(zip(moves, runs, strict=True)):
        start = round(run.start_s / period_s, 9)  # in ticks; whole where the grid is, so that laps are bit-identical
        end = count if index == len(runs) - 1 else _first_tick(run.end_s / period_s)
        segment[_first_tick(start) : end] = index
        begin_s = 0.0
        for piece in (*move.pieces, Cubic(run.end_s - run.start_s, move.end_m)):
            end_s = begin_s + piece.duration_s
            ticks = slice(_first_tick(start + begin_s / period_s), min(end, _first_tick(start + end_s / period_s)))
            within_s = np.clip((np.arange(ticks.start, ticks.stop) - start) * period_s - begin_s, 0.0, piece.duration_s)
            for whole, part in zip(motion, piece.at(within_s), strict=True):
                whole[ticks] = part
            begin_s = end_s
    return Trajectory(period_s, time_s, *motion, segment, runs, notes)


def _first_tick(instant: float) -> int:
    """The first whole number at or after an instant in ticks, but for rounding."""
    return math.ceil(instant - 1e-9)


def _check_period(period_s: float) -> None:
    if not (period_s > 0 and math.isfinite(period_s)):
        raise FieldError(("period_s",), f"given {period_s}, allowed a positive number; correct it")
