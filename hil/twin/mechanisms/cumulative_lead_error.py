"""Cumulative lead error: an error of the lead that grows along the travel."""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _longer_lead(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    # the motor position is the table's, but for deflections of the order of the error
    return value + parameters[0] * at.table_position_m / at.ratio_m


MECHANISM = Mechanism(
    id="cumulative_lead_error",
    block=Block.TRANSMISSION,
    element="ball screw",
    equation="x = (1 + s) r theta",
    source="ISO 3408-3:2006, mean travel deviation",
    parameters=(Parameter("slope_m_m", Dimension.RATIO, -5e-3, 5e-3, role=Role.STRENGTH),),
    variants=(Variant(Stage.TRANSMISSION, _longer_lead),),
    text=Text(
        "The lead is wrong: the table goes {slope_m_m} too far for each metre of travel.",
        Picture.LEAD_OVER_TRAVEL,
        reversed="The lead is wrong: the table goes {slope_m_m} too little for each metre of travel.",
    ),
    search=SearchHints(lambda s: [(1e-6 / s.travel_m,)], lambda a: (20e-6,), needs_table=True),
)
