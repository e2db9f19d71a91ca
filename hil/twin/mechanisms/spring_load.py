"""Spring load: a force on the table proportional to its position."""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.mechanisms.constant_load import MECHANISM as LOAD
from hil.twin.parameter import ANYWHERE, Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts, Scene


@njit
def _pull_to_rest(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value - parameters[0] * (at.table_position_m - parameters[1])


# Travels beyond either end: the force of a spring that rests farther away is mostly constant, and told as a weight;
# what is left of its slope may be found as a spring beside it. Farther than `_FAR` nothing tells it from a weight.
_NEAR, _FAR = 1.0, 30.0


def _starts(s: Scene) -> list[tuple[float, ...]]:
    """Rest positions at the start of the axis, 20 travels away, where the force is nearly constant, and as it shows."""
    stiffness = 0.02 * s.coulomb / s.ratio / s.travel_m
    return [(stiffness, rest_m) for rest_m in (0.0, -20.0 * s.travel_m, 20.0 * s.travel_m, s.rest_m)]


def _away(values: Sequence[float], axis: AxisFacts) -> float:
    """Distance of the rest position from the travel [m], negative within it."""
    first_m, last_m = axis.positions_m
    return max(first_m - values[1], values[1] - last_m)


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the force depends on the position."""
    return _away(values, axis) < _FAR * axis.travel_m


def _is_weight(values: Sequence[float], axis: AxisFacts) -> bool:
    """True for a force that is mostly constant."""
    return _away(values, axis) >= _NEAR * axis.travel_m


def _weight(values: Sequence[float], axis: AxisFacts) -> tuple[str, tuple[float, ...]]:
    """The constant load with the force of the spring in the middle of the travel."""
    return LOAD.id, (values[0] * (axis.middle_m - values[1]) * axis.ratio,)


MECHANISM = Mechanism(
    id="spring_load",
    block=Block.TABLE,
    element="cable chain, hoses or counterbalance",
    equation="F_table = -k (x - x0)",
    source="Hooke's law; Groß, Hamann and Wiegärtner, Electrical Feed Drives in Automation (2001), load forces",
    parameters=(
        Parameter("stiffness_n_m", Dimension.STIFFNESS, 0.0, 1e7, role=Role.STRENGTH),
        Parameter("rest_position_m", Dimension.LENGTH, -ANYWHERE, ANYWHERE),
    ),
    variants=(Variant(Stage.TABLE_FORCE, _pull_to_rest),),
    text=Text(
        "A force that grows by {stiffness_n_m} pulls the table back, as of a spring, a chain or a hose; its rest is at "
        "{rest_position_m}.",
        Picture.FORCE_OVER_TRAVEL,
    ),
    search=SearchHints(_starts, lambda a: (0.5 * a.friction / a.ratio, 0.0)),
    can_be=_valid,
    is_another=_is_weight,
    beyond=_weight,
)
