"""A share by which a value differs in a zone of the travel, with straight flanks."""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Moment, Row
from hil.twin.parameter import ANYWHERE, Dimension, Parameter
from hil.twin.scene import AxisFacts

# Shortest flank [m]: an axis needs several internal steps for it, so that the twin is continuous in the edges.
_STEEPEST_M = 1e-3
_LENGTH_M = 0.03  # of a zone
_WHOLE = 0.8  # share of the travel above which a zone is the travel, and its value that of the axis
_FLANKS = (0.1, 0.8)  # of the length of the zone: steep, and nearly a triangle
SHAPE = "s = 1 in the zone, 0 outside, straight flanks; half height at its begin and end"


def edges(begin: str, end: str, flank: str) -> tuple[Parameter, ...]:
    """Parameters of a zone by their names: where it begins and ends, and the length of its flanks [m]."""
    ends = (Parameter(name, Dimension.LENGTH, -ANYWHERE, ANYWHERE, scale=_LENGTH_M) for name in (begin, end))
    return (*ends, Parameter(flank, Dimension.LENGTH, _STEEPEST_M, ANYWHERE))


@njit
def changed_in_zone(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    """The value times 1 + a s(x); `parameters` are a and the `edges`."""
    fraction, begin_m, end_m, flank_m = parameters[0], parameters[1], parameters[2], parameters[3]
    if flank_m <= 0.0:
        return value
    inside_m = min(at.table_position_m - begin_m, end_m - at.table_position_m)
    return value * (1.0 + fraction * min(max(inside_m / flank_m + 0.5, 0.0), 1.0))


def is_zone(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """True if the zone is a part of the travel, and most of it is within the travel."""
    _, begin_m, end_m, flank_m = values
    first_m, last_m = axis.positions_m
    inside_m = min(end_m, last_m) - max(begin_m, first_m)
    return flank_m <= end_m - begin_m <= min(_WHOLE * axis.travel_m, 2.0 * inside_m)


def starts_in(zones: Sequence[tuple[float, float, float]]) -> list[tuple[float, ...]]:
    """Values of a and the `edges` for zones of begin, end [m] and a."""
    return [
        (fraction, begin_m, end_m, flank * (end_m - begin_m)) for begin_m, end_m, fraction in zones for flank in _FLANKS
    ]
