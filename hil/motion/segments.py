"""Segments of a profile file: what each may say, and the move it means.

A segment runs from rest to rest. `move(start_m, limits)` raises FieldError with the path of the field inside
the segment when it cannot be made within the limits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from hil.errors import FieldError, FieldPath
from hil.motion.excitation import Chirp, Multisine, Spectrum, excitation
from hil.motion.pieces import MotionLimits, Move, dwell
from hil.motion.sine_squared import ramp_duration_s, reversals, sine_squared
from hil.motion.time_optimal import jog, point_to_point

Positive = Annotated[float, Field(gt=0)]
Position = Annotated[float, Field(ge=-100, le=100)]
MAX_LINE_PERIODS = 1_000_000  # of a multisine, some seconds of computing
Feed = Annotated[float, Field(gt=0, description="feed [m/s]")]


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Limited(Part):
    """A segment that may keep lower limits than the profile."""

    acceleration_m_s2: Positive | None = Field(None, description="lower limit of this segment [m/s^2]")
    jerk_m_s3: Positive | None = Field(None, description="lower limit of this segment [m/s^3]")

    def lowered(self, limits: MotionLimits, feed_m_s: float, field: FieldPath = ("feed_m_s",)) -> MotionLimits:
        """The limits of this segment, with its feed as the limit of velocity."""
        given = {"velocity_m_s": feed_m_s, "acceleration_m_s2": self.acceleration_m_s2, "jerk_m_s3": self.jerk_m_s3}
        own = {name: value for name, value in given.items() if value is not None}
        for name, value in own.items():
            if value > getattr(limits, name):
                raise FieldError(
                    field if name == "velocity_m_s" else (name,),
                    f"given {value:.6g}, allowed up to {getattr(limits, name):.6g} (limits.{name}); "
                    "lower it or raise the limit",
                )
        return replace(limits, **own)


class _Travel(_Limited):
    """A segment that goes somewhere."""

    to_m: Position | None = Field(None, description="where the move ends [m]")
    stroke_m: Position | None = Field(None, description="how far the move goes [m], negative backwards")
    feed_m_s: Feed

    @model_validator(mode="after")
    def _one_target(self) -> Self:
        if (self.to_m is None) == (self.stroke_m is None):
            given = "neither of" if self.to_m is None else "both"
            raise FieldError(("stroke_m",), f"given {given} to_m and stroke_m, allowed one; choose")
        if self.stroke_m == 0:
            raise FieldError(("stroke_m",), "given 0, allowed any other length; use a dwell to rest")
        return self

    def target_m(self, start_m: float) -> float:
        return self.to_m if self.to_m is not None else start_m + (self.stroke_m or 0.0)


class SineSquaredSegment(_Travel):
    """Move with sine-squared velocity ramps; a feed that is not reached within the stroke is lowered."""

    kind: Literal["sine_squared"]

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        return sine_squared(start_m, self.target_m(start_m), self.lowered(limits, self.feed_m_s))


class ApproachSegment(_Travel):
    """Time-optimal move (ruckig)."""

    kind: Literal["approach"]

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        return point_to_point(start_m, self.target_m(start_m), self.lowered(limits, self.feed_m_s))


class DwellSegment(Part):
    """Rest."""

    kind: Literal["dwell"]
    duration_s: Positive = Field(description="rest [s]")

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        return dwell(start_m, self.duration_s)


class JogSegment(_Limited):
    """A velocity for a duration, then a stop (ruckig)."""

    kind: Literal["jog"]
    velocity_m_s: float = Field(description="velocity [m/s], negative backwards")
    duration_s: Positive = Field(description="from rest to the beginning of the stop [s]")

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        limits = self.lowered(limits, abs(self.velocity_m_s), ("velocity_m_s",))
        return jog(start_m, self.velocity_m_s, self.duration_s, limits)


class ReversalSegment(_Limited):
    """Triangles at constant feed that turn without a rest: creep, lost motion, friction around zero speed."""

    kind: Literal["reversal"]
    stroke_m: Position = Field(description="from the start to the far end [m], negative backwards")
    feed_m_s: Feed
    cycles: int = Field(1, ge=1, le=1000, description="there and back, so many times")

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        return reversals(start_m, self.stroke_m, self.cycles, self.lowered(limits, self.feed_m_s))


class FeedSweepSegment(_Limited):
    """Both directions at each feed, with a stretch at constant feed, to identify friction."""

    kind: Literal["feed_sweep"]
    feeds_m_s: tuple[Positive, ...] = Field(min_length=1, max_length=200, description="feeds [m/s]")
    constant_feed_s: Positive = Field(description="stretch at constant feed [s], shortened where it does not fit")
    stroke_max_m: Positive = Field(description="longest stroke [m], forwards from the start")
    dwell_s: float = Field(0.0, ge=0, description="rest at each end [s]")

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        moves = []
        for index, feed in enumerate(self.feeds_m_s):
            field = ("feeds_m_s", index)
            own = self.lowered(limits, feed, field)
            ramp_s = ramp_duration_s(feed, own)
            stroke_m = min(self.stroke_max_m, feed * (self.constant_feed_s + ramp_s))
            constant_s = stroke_m / feed - ramp_s
            if constant_s <= 0:
                raise FieldError(
                    field,
                    f"given {feed:.6g} m/s, which the limits do not reach within "
                    f"{self.stroke_max_m * 1e3:.6g} mm; lower the feed or raise stroke_max_m",
                )
            notes = (
                ()
                if constant_s > self.constant_feed_s - 1e-9
                else (f"{feed:.6g} m/s: constant feed shortened to {constant_s:.3g} s to fit stroke_max_m",)
            )
            for position in (start_m, start_m + stroke_m):
                there = 2 * start_m + stroke_m - position
                moves.append(replace(sine_squared(position, there, own), notes=notes))
                moves.append(dwell(there, self.dwell_s))
                notes = ()
        return Move(
            tuple(piece for move in moves for piece in move.pieces if piece.duration_s > 0),
            start_m,
            tuple(note for move in moves for note in move.notes),
        )


class _Excitation(Part):
    """A signal on the position; the amplitude is lowered where it would pass a limit."""

    start_hz: float = Field(ge=0.01, le=500, description="begin of the band [Hz]")
    end_hz: float = Field(ge=0.01, le=500, description="end of the band [Hz]")
    amplitude_m: Positive = Field(description="largest displacement [m]")
    spectrum: Spectrum = Field(Spectrum.CONSTANT_VELOCITY, description="what stays equal over the band")
    base_feed_m_s: float = Field(0.0, description="constant feed under it [m/s], keeps friction sliding")


class ChirpSegment(_Excitation):
    """Exponential sweep over a band."""

    kind: Literal["chirp"]
    duration_s: float = Field(ge=0.1, le=120, description="length of the sweep [s]; a tenth at each end fades")

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        signal = Chirp(self.start_hz, self.end_hz, self.duration_s, self.spectrum)
        return excitation(
            start_m, signal, self.duration_s, self.duration_s / 10, self.amplitude_m, self.base_feed_m_s, limits
        )


class MultisineSegment(_Excitation):
    """Equidistant lines over a band, all at once, in laps that repeat exactly."""

    kind: Literal["multisine"]
    lap_s: float = Field(ge=0.01, le=100, description="lap [s]; the lines lie 1/lap_s apart")
    laps: int = Field(2, ge=1, le=100, description="whole laps; half a lap before and after them fades")

    def move(self, start_m: float, limits: MotionLimits) -> Move:
        signal = Multisine(self.start_hz, self.end_hz, self.lap_s, self.spectrum)
        lines, duration_s = len(signal.lines_hz), (self.laps + 1) * self.lap_s
        if lines == 0 or lines * duration_s * self.end_hz > MAX_LINE_PERIODS:
            raise FieldError(
                ("lap_s",),
                f"given {lines} lines from {self.start_hz:.6g} to {self.end_hz:.6g} Hz over "
                f"{duration_s:.6g} s, allowed at least one, and lines x time x end_hz up to "
                f"{MAX_LINE_PERIODS}; change lap_s or the band",
            )
        return excitation(start_m, signal, duration_s, self.lap_s / 2, self.amplitude_m, self.base_feed_m_s, limits)


class RepeatSegment(Part):
    """Segments one after the other, several times."""

    kind: Literal["repeat"]
    times: int = Field(ge=1, le=10_000, description="number of laps")
    segments: tuple[Segment, ...] = Field(min_length=1, description="what one lap consists of")


Segment = Annotated[
    SineSquaredSegment
    | ApproachSegment
    | DwellSegment
    | JogSegment
    | ReversalSegment
    | FeedSweepSegment
    | ChirpSegment
    | MultisineSegment
    | RepeatSegment,
    Field(discriminator="kind"),
]
