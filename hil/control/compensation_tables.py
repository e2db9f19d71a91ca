"""Tables of a compensation: what is added to the set-points, over what; plain arrays in SI, for the loop and exports.

    torque    += sum of torque tables       position set-point += sum of position tables

A table is a line through its knots. Over the motor angle it is periodic in 2 pi; over velocity and acceleration the
outer lines go on; elsewhere the outer values hold. It has one column for motion away from home and one for the way
back. Over a velocity, a position or an angle they differ for what depends on the direction; over the way or the time
since a reversal they are a pulse of each direction, less after a stroke in which the one before it has not ended and
below the speed at which the direction counts. Everything goes by set-points, nothing by a measured value.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray


class Adds(StrEnum):
    """Quantity that a table adds to."""

    TORQUE = "torque"  # N m at the motor; N on a linear axis
    POSITION = "position_m"  # of the set-point [m]; rad where the load turns


class Over(StrEnum):
    """Quantity of the set-points over which a table goes."""

    VELOCITY = "velocity_m_s"
    ACCELERATION = "acceleration_m_s2"
    ANGLE = "motor_angle_rad"  # of the motor, 0 to 2 pi
    POSITION = "position_m"
    REVERSAL_TIME = "since_reversal_s"
    REVERSAL_WAY = "since_reversal_m"


@dataclass(frozen=True, eq=False)
class CompensationTable:
    """One table: knots `at` (n,) in ascending order, values `forward` and `backward` (n,) [N m, N, or m]."""

    name: str
    adds: Adds
    over: Over
    at: FloatArray
    forward: FloatArray
    backward: FloatArray


class CompensationLimits(NamedTuple):
    """Bounds of all tables together; torque in N m (N), per second for its slope."""

    torque: float
    torque_slope: float
    position_m: float
    speed_m_s: float  # of the correction of the position
    fade_in_s: float  # 0 to 1 after the start of a run
    direction_m_s: float  # torque tables change from one direction to the other within +- this velocity


@dataclass(frozen=True, eq=False)
class Compensation:
    """Tables and their limits; `angle_per_m`: motor angle per metre of the set-point [rad/m]."""

    tables: tuple[CompensationTable, ...]
    limits: CompensationLimits
    angle_per_m: float


class Packed(NamedTuple):
    """A compensation as the compiled step takes it: knots (3, n), layout (tables, 4), constants (8,)."""

    knots: FloatArray  # at, forward, backward of all tables
    layout: NDArray[np.int64]  # 1: adds to the torque; place in `Over`; first knot; knot after the last
    constants: FloatArray  # `CompensationLimits`, angle per metre, period of a tick


OFF = Compensation((), CompensationLimits(0.0, math.inf, 0.0, math.inf, 0.0, 1.0), 1.0)
_PLACES = {over: place for place, over in enumerate(Over)}


def pack(compensation: Compensation, period_s: float) -> Packed:
    """Pack tables for the compiled step; over an angle the first knot is repeated after a turn, so that it is periodic.

    Raises ValueError for columns of another length than the knots, or knots that do not ascend.
    """
    columns, layout, first = [np.empty((3, 0))], [], 0
    for table in compensation.tables:
        at, forward, backward = (np.asarray(one, dtype=np.float64) for one in (table.at, table.forward, table.backward))
        if not at.size or at.shape != forward.shape or at.shape != backward.shape or np.any(np.diff(at) <= 0.0):
            raise ValueError(f"{table.name}: knots must ascend, with a value each, got {at.size} of them")
        if table.over is Over.ANGLE:
            if at[0] < 0.0 or at[-1] >= 2.0 * math.pi:
                raise ValueError(f"{table.name}: angles must be from 0 to below 2 pi, got {at[0]} to {at[-1]}")
            at = np.append(at, at[0] + 2.0 * math.pi)
            forward, backward = np.append(forward, forward[0]), np.append(backward, backward[0])
        columns.append(np.stack([at, forward, backward]))
        layout.append((int(table.adds is Adds.TORQUE), _PLACES[table.over], first, first + at.size))
        first += at.size
    return Packed(
        np.ascontiguousarray(np.concatenate(columns, axis=1)),
        np.array(layout, dtype=np.int64).reshape(-1, 4),
        np.array([*compensation.limits, compensation.angle_per_m, period_s]),
    )
