"""Maps: terms for an effect that has no name, a line through six knots over one quantity, constant beyond.

They are no mechanisms of the library: a search never fits them, so that a map hides no named cause.
"""

from collections.abc import Callable

from numba import njit

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


def _parameters(over: str, quantity: Dimension, of: str, what: Dimension) -> tuple[Parameter, ...]:
    return (
        Parameter(f"first_{over}", quantity, -1e4, 1e4),
        Parameter(f"last_{over}", quantity, -1e4, 1e4),
        *(Parameter(f"knot_{number}_{of}", what, -1e6, 1e6, role=Role.STRENGTH) for number in range(1, KNOTS + 1)),
    )


def _map(
    name: str, block: Block, stage: Stage, law: Callable[..., float], text: str, parameters: tuple[Parameter, ...]
) -> Mechanism:
    return Mechanism(
        id=name,
        block=block,
        element="unknown",
        equation="straight lines between six knots",
        source="measured residual; no law",
        parameters=parameters,
        variants=(Variant(stage, law),),
        text=Text(text, Picture.TIME),
    )


TORQUE_OVER_POSITION = _map(
    "unnamed_torque_over_position",
    Block.MOTOR_SIDE,
    Stage.MOTOR_TORQUE,
    _torque_over_position,
    "The axis needs more torque that depends on the position.",
    _parameters("position_m", Dimension.LENGTH, "n_m", Dimension.TORQUE),
)
TORQUE_OVER_SPEED = _map(
    "unnamed_torque_over_speed",
    Block.MOTOR_SIDE,
    Stage.MOTOR_TORQUE,
    _torque_over_speed,
    "The axis needs more torque that depends on the speed.",
    _parameters("speed_rad_s", Dimension.MOTOR_SPEED, "n_m", Dimension.TORQUE),
)
READING_OVER_POSITION = _map(
    "unnamed_reading_over_position",
    Block.SENSOR,
    Stage.TABLE_READING,
    _reading_over_position,
    "The second encoder reads more than the position of the table, depending on the position.",
    _parameters("position_m", Dimension.LENGTH, "m", Dimension.LENGTH),
)
MAPS = (TORQUE_OVER_POSITION, TORQUE_OVER_SPEED, READING_OVER_POSITION)
