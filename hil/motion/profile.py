"""Profile files: limits, travel, and segments in the order of their execution."""

import math
from collections import Counter
from functools import cached_property
from itertools import chain, islice, repeat
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from hil.errors import FieldError, FieldPath, HilError
from hil.files.output import write_text
from hil.files.shipped import given_or_shipped
from hil.files.yaml_model import load_model
from hil.motion.excitation import SAMPLES_PER_PERIOD
from hil.motion.pieces import MAX_DURATION_S, MotionLimits, Move
from hil.motion.segments import Part, Position, Positive, RepeatSegment, Segment

MAX_MOVES = 100_000


class Limits(Part):
    """Largest magnitudes of the set-points of a profile."""

    velocity_m_s: Positive = Field(description="largest velocity [m/s]")
    acceleration_m_s2: Positive = Field(description="largest acceleration [m/s^2]")
    jerk_m_s3: Positive = Field(description="largest jerk [m/s^3]")


class Run(NamedTuple):
    """An executed segment: its place in the file, the number of its earlier executions, and its move."""

    field: FieldPath
    kind: str
    lap: int
    start_m: float
    move: Move


class Profile(Part):
    """A trajectory profile: limits and the segments that run one after the other, each from rest to rest."""

    schema_version: Literal[1] = Field(description="version of the format")
    description: str = Field("", description="what the profile is for")
    limits: Limits = Field(description="largest magnitudes of the set-points")
    start_m: Position = Field(0.0, description="where the profile starts [m]")
    position_min_m: Position | None = Field(None, description="lower end of the travel [m]")
    position_max_m: Position | None = Field(None, description="upper end of the travel [m]")
    grid_s: float = Field(
        0.004,
        ge=1e-4,
        le=1,
        description="segments begin at multiples of this time [s], after a "
        "short rest, so that laps repeat sample by sample",
    )
    segments: tuple[Segment, ...] = Field(min_length=1, description="what runs, in this order")

    @property
    def motion_limits(self) -> MotionLimits:
        return MotionLimits(**self.limits.model_dump())

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The executed segments in order, repeats unrolled.

        FieldError where one cannot be made, leaves the travel, or the profile gets too long.
        """
        position, duration_s = self.start_m, 0.0
        runs: list[Run] = []
        laps = Counter[FieldPath]()
        known: dict[tuple[FieldPath, float], tuple[Move, float]] = {}  # laps are often from the same place
        for field, segment in _unrolled(self.segments, ("segments",)):
            if (field, position) not in known:
                known[field, position] = self._move(field, segment, position)
            move, taken_s = known[field, position]
            duration_s += taken_s
            if duration_s > MAX_DURATION_S or len(runs) == MAX_MOVES:
                raise FieldError(
                    field,
                    f"given a profile that is longer than {MAX_DURATION_S:.0f} s or "
                    f"{MAX_MOVES} moves here, allowed up to that; shorten it",
                )
            runs.append(Run(field, segment.kind, laps[field], position, move))
            laps[field] += 1
            position = move.end_m
        return tuple(runs)

    def _move(self, field: FieldPath, segment: Any, position_m: float) -> tuple[Move, float]:
        """The move of a segment from a position, and the time that it takes [s]."""
        try:
            move = segment.move(position_m, self.motion_limits)
            taken_s = self.slots(move) * self.grid_s
        except FieldError as error:
            raise error.inside(*field) from None
        except (ArithmeticError, HilError) as error:  # numbers such as 1e-320, which are not zero
            raise FieldError(
                field,
                f"given values that cannot be computed with ({error}), allowed such as machines have; correct them",
            ) from None
        if taken_s <= MAX_DURATION_S:
            self._check_travel(field, move)
        return move, taken_s

    def slots(self, move: Move) -> int:
        """Multiples of grid_s that a move takes."""
        return math.ceil(move.duration_s / self.grid_s - 1e-9)

    def check_position(self, field: FieldPath, lowest_m: float, highest_m: float) -> None:
        """FieldError when a range of positions is not inside the travel."""
        low = -math.inf if self.position_min_m is None else self.position_min_m
        high = math.inf if self.position_max_m is None else self.position_max_m
        if not low - 1e-9 <= lowest_m <= highest_m <= high + 1e-9:  # neither when they are not a number
            raise FieldError(
                field,
                f"given positions from {lowest_m:.6g} to {highest_m:.6g} m, allowed {low:.6g} "
                f"to {high:.6g} m (position_min_m, position_max_m); move less far or start elsewhere",
            )

    def _check_travel(self, field: FieldPath, move: Move) -> None:
        ends: list[float] = []
        for piece in move.pieces:
            count = 65 + math.ceil(SAMPLES_PER_PERIOD * piece.duration_s * move.highest_frequency_hz)
            positions = piece.at(np.linspace(0.0, piece.duration_s, count)).position_m
            ends += [float(positions.min()), float(positions.max())]
        if ends:
            self.check_position(field, min(ends), max(ends))

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        self.check_position(("start_m",), self.start_m, self.start_m)
        _ = self.runs
        return self


def _unrolled(segments: tuple[Any, ...], field: FieldPath) -> list[tuple[FieldPath, Any]]:
    """The segments with their places, repeats unrolled to the first one above `MAX_MOVES`."""
    flat: list[tuple[FieldPath, Any]] = []
    for index, segment in enumerate(segments):
        here = (*field, index)
        if isinstance(segment, RepeatSegment):
            lap = _unrolled(segment.segments, (*here, "segments"))
            flat += islice(chain.from_iterable(repeat(lap, segment.times)), max(0, MAX_MOVES + 1 - len(flat)))
        else:
            flat.append((here, segment))
    return flat


def write_profile(path: Path, profile: Profile) -> None:
    """Write a profile as the YAML file that `load_profile` reads. Raises InputError where it cannot be written."""
    import yaml

    data = profile.model_dump(mode="json", exclude_defaults=True)
    write_text(path, yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120))


def load_profile(source: str | Path) -> Profile:
    """Load a profile file, or a shipped profile by its name.

    Raises InputError with file, line and field for anything that cannot be run.
    """
    return load_model(given_or_shipped(source, "profile"), Profile)
