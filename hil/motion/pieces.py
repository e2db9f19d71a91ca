"""Pieces of motion in closed form, and a move made of them."""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from hil.arrays import FloatArray
from hil.errors import FieldError

Array = FloatArray
MAX_DURATION_S = 3600.0  # of a trajectory, which is held in memory


class Motion(NamedTuple):
    """Set-points over time, one array each."""

    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array
    jerk_m_s3: Array


@dataclass(frozen=True)
class MotionLimits:
    """Largest magnitudes allowed; FieldError unless all are positive and finite."""

    velocity_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (value > 0 and math.isfinite(value)):
                raise FieldError((name,), f"given {value}, allowed a positive number; correct the limit")


class Piece(Protocol):
    """Motion between t = 0 and duration_s."""

    @property
    def duration_s(self) -> float: ...

    def at(self, time_s: Array) -> Motion:
        """Set-points at times within the piece."""


@dataclass(frozen=True)
class Cubic:
    """Constant jerk: rest, constant feed, and the sections of ruckig."""

    duration_s: float
    position_m: float
    velocity_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    jerk_m_s3: float = 0.0

    def at(self, time_s: Array) -> Motion:
        p, v, a, j, t = self.position_m, self.velocity_m_s, self.acceleration_m_s2, self.jerk_m_s3, time_s
        return Motion(p + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j, j + 0 * t)


@dataclass(frozen=True)
class Ramp:
    """Change of velocity by the square of a sine, v = v0 + dv sin^2(pi t/(2 T)); see hil.motion.sine_squared."""

    duration_s: float
    position_m: float
    velocity_m_s: float
    end_velocity_m_s: float

    def at(self, time_s: Array) -> Motion:
        # sin^2(x) = (1 - cos 2x)/2, once integrated and twice differentiated
        t, half, turn = time_s, (self.end_velocity_m_s - self.velocity_m_s) / 2, math.pi / self.duration_s
        sine, cosine = np.sin(turn * t), np.cos(turn * t)
        return Motion(
            self.position_m + self.velocity_m_s * t + half * (t - sine / turn),
            self.velocity_m_s + half * (1 - cosine),
            half * turn * sine,
            half * turn * turn * cosine,
        )


@dataclass(frozen=True)
class Move:
    """Pieces one after the other, up to end_m; `notes` say what was changed to hold the limits."""

    pieces: tuple[Piece, ...]
    end_m: float
    notes: tuple[str, ...] = ()
    highest_frequency_hz: float = 0.0  # of an excitation

    @property
    def duration_s(self) -> float:
        return math.fsum(piece.duration_s for piece in self.pieces)


def end_m(piece: Piece) -> float:
    """Position [m] at the end of a piece."""
    return float(piece.at(np.array(piece.duration_s)).position_m)


def dwell(start_m: float, duration_s: float) -> Move:
    """Rest at start_m."""
    return Move((Cubic(duration_s, start_m),), start_m)
