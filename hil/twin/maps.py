"""Maps: terms for an effect that has no name, a line through six knots over one quantity.

It is constant beyond its ends, or repeats over the position, with its knots at equal steps of a period. Maps are no
mechanisms of the library: a search never fits them, so that a map hides no named cause.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numba import njit

from hil.arrays import FloatArray
from hil.twin.mechanism import Block, Mechanism, Moment, Row, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture

KNOTS = 6


@njit
def _along(x: float, parameters: Row) -> float:
    if parameters[1] <= parameters[0]:
        return parameters[2]
    share = (x - parameters[0]) / (parameters[1] - parameters[0]) * 5.0
    if share <= 0.0:
        return parameters[2]
    if share >= 5.0:
        return parameters[7]
    first = int(share)
    low, high = parameters[2 + first], parameters[3 + first]
    return low + (share - first) * (high - low)


@njit
def _within(x: float, parameters: Row) -> float:
    period = parameters[1] - parameters[0]
    if period <= 0.0:
        return parameters[2]
    share = ((x - parameters[0]) / period) % 1.0 * 6.0
    first = int(share)
    low, high = parameters[2 + first % 6], parameters[2 + (first + 1) % 6]
    return low + (share - first) * (high - low)


@njit
def _torque_over_position(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    line: float = _along(at.table_position_m, parameters)
    return value - line


@njit
def _torque_over_speed(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    line: float = _along(at.velocity, parameters)
    return value - line


@njit
def _reading_over_position(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    line: float = _along(at.table_position_m, parameters)
    return value + line


@njit
def _torque_within_period(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    line: float = _within(at.table_position_m, parameters)
    return value - line


@njit
def _reading_within_period(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    line: float = _within(at.table_position_m, parameters)
    return value + line


def _map(
    name: str,
    stage: Stage,
    law: Callable[..., float],
    text: str,
    over: str = "position_m",
    along: Dimension = Dimension.LENGTH,
) -> Mechanism:
    of_torque = stage is Stage.MOTOR_TORQUE
    of, what = ("n_m", Dimension.TORQUE) if of_torque else ("m", Dimension.LENGTH)
    return Mechanism(
        id=name,
        block=Block.MOTOR_SIDE if of_torque else Block.SENSOR,
        element="unknown",
        equation="straight lines between six knots",
        source="measured residual; no law",
        parameters=(
            Parameter(f"first_{over}", along, -1e4, 1e4),
            Parameter(f"last_{over}", along, -1e4, 1e4),
            *(Parameter(f"knot_{number}_{of}", what, -1e6, 1e6, role=Role.STRENGTH) for number in range(1, KNOTS + 1)),
        ),
        variants=(Variant(stage, law),),
        text=Text(text, Picture.TIME),
    )


TORQUE_OVER_POSITION = _map(
    "unnamed_torque_over_position",
    Stage.MOTOR_TORQUE,
    _torque_over_position,
    "The axis needs more torque that depends on the position.",
)
TORQUE_OVER_SPEED = _map(
    "unnamed_torque_over_speed",
    Stage.MOTOR_TORQUE,
    _torque_over_speed,
    "The axis needs more torque that depends on the speed.",
    "speed_rad_s",
    Dimension.MOTOR_SPEED,
)
READING_OVER_POSITION = _map(
    "unnamed_reading_over_position",
    Stage.TABLE_READING,
    _reading_over_position,
    "The second encoder reads more than the position of the table, depending on the position.",
)
TORQUE_WITHIN_PERIOD = _map(
    "unnamed_torque_within_period",
    Stage.MOTOR_TORQUE,
    _torque_within_period,
    "The axis needs more torque that depends on the place within a period of the position.",
)
READING_WITHIN_PERIOD = _map(
    "unnamed_reading_within_period",
    Stage.TABLE_READING,
    _reading_within_period,
    "The second encoder reads more than the position of the table, depending on the place within a period.",
)
MAPS = (
    TORQUE_OVER_POSITION, TORQUE_OVER_SPEED, READING_OVER_POSITION, TORQUE_WITHIN_PERIOD, READING_WITHIN_PERIOD
)  # fmt: skip


def knots(values: Sequence[float], period: float) -> tuple[FloatArray, FloatArray]:
    """Places and heights of the knots of a map with its values; of one that repeats with a `period` over one period."""
    heights = np.array(values[2:])
    if not period:
        return np.linspace(values[0], values[1], KNOTS), heights
    return np.linspace(0.0, period, KNOTS + 1), np.append(heights, heights[0])
