"""End stop: near one end of its travel the table runs into an elastic stop.

A rubber buffer, a bellows or a telescopic cover at its limit, or a hose that becomes tight: a spring that only pushes
back. A spring over the whole travel is a `spring_load`.
"""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import ANYWHERE, Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts, Scene

_LEAST = 1e-3  # share of the travel beyond the edge, below which a stop is not reached
_MOST = 0.5  # and above which it is no stop at an end
_DEPTHS = (0.005, 0.02, 0.06, 0.15, 0.3)  # of the travel beyond the edge, at the start of a search
_SCALE_M = 1e-3  # of the edge
_MEASURE = 0.2  # of Coulomb friction: force at the end of the travel, at the start of a search


@njit
def _above(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value - parameters[0] * max(at.table_position_m - parameters[1], 0.0)


@njit
def _below(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0] * max(parameters[1] - at.table_position_m, 0.0)


def _is_at_an_end(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """True if the axis reaches the stop, and most of the travel is free."""
    first_m, last_m = axis.positions_m
    beyond_m = last_m - values[1] if variant == 0 else values[1] - first_m
    return _LEAST * axis.travel_m <= beyond_m <= _MOST * axis.travel_m


def _at(scene: Scene, upper: bool) -> list[tuple[float, ...]]:
    """Some edges near an end of the recorded travel."""
    first_m, last_m = scene.positions_m
    force_n = _MEASURE * scene.coulomb / scene.ratio
    depths_m = [share * (last_m - first_m) for share in _DEPTHS]
    return [(force_n / depth_m, last_m - depth_m if upper else first_m + depth_m) for depth_m in depths_m if depth_m]


MECHANISM = Mechanism(
    id="end_stop",
    block=Block.TABLE,
    element="buffer, bellows or cover at an end of the travel",
    equation="F_table = -k max(x - x0, 0) at the upper end, k max(x0 - x, 0) at the lower end",
    source="Hunt and Crossley, J. Appl. Mech. 42 (1975) 440, contact with a stop; Johnson, Contact Mechanics (1985): "
    "linear as Hooke's law, since a buffer is no sphere",
    parameters=(
        Parameter("stiffness_n_m", Dimension.STIFFNESS, 0.0, 1e7, role=Role.STRENGTH),
        Parameter("edge_m", Dimension.LENGTH, -ANYWHERE, ANYWHERE, scale=_SCALE_M),
    ),
    variants=(
        Variant(Stage.TABLE_FORCE, _above, "upper end", starts=lambda s: _at(s, upper=True)),
        Variant(
            Stage.TABLE_FORCE,
            _below,
            "lower end",
            text=Text(
                "From {edge_m} to the lower end of the travel, an elastic stop of {stiffness_n_m} pushes the "
                "table back."
            ),
            starts=lambda s: _at(s, upper=False),
        ),
    ),
    text=Text(
        "From {edge_m} to the upper end of the travel, an elastic stop of {stiffness_n_m} pushes the table back.",
        Picture.FORCE_OVER_TRAVEL,
    ),
    search=SearchHints(typical=lambda a: (100.0 * a.friction / a.ratio, 0.1)),
    can_be=_is_at_an_end,
    most=2,  # one at each end
)
