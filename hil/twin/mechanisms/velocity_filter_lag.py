"""Velocity filter lag: the controller filters its velocity feedback."""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _time_constant(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0]


MECHANISM = Mechanism(
    id="velocity_filter_lag",
    block=Block.CONTROLLER,
    element="velocity feedback of the controller",
    equation="tau dv_f/dt = v - v_f",
    source="Brown, Schneider and Mulligan, IEEE Trans. Industrial Electronics 39 (1992) 11, filtered differences",
    parameters=(Parameter("time_constant_s", Dimension.TIME, 1e-5, 0.05, role=Role.STRENGTH),),
    variants=(Variant(Stage.VELOCITY_FILTER, _time_constant),),
    text=Text("The controller filters its velocity feedback with a time constant of {time_constant_s}.", Picture.DELAY),
    search=SearchHints(lambda s: [(2e-4,), (1e-3,)], lambda a: (5e-4,), proportional=False),
)
