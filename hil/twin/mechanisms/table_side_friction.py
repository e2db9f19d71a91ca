"""Table-side friction: part of the friction acts on the guideway, behind the compliance."""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _share_on_table(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0]


MECHANISM = Mechanism(
    id="table_side_friction",
    block=Block.TABLE,
    element="guideways",
    equation="F_table = s F, F_motor = (1 - s) F",
    source="Altintas, Verl, Brecher, Uriarte and Pritschow, Machine tool feed drives, CIRP Annals 60 (2011) 779",
    parameters=(Parameter("share", Dimension.RATIO, 0.0, 1.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.TABLE_SHARE, _share_on_table),),
    text=Text("A share of {share} of the friction acts on the table, not on the motor.", Picture.LOST_MOTION),
    search=SearchHints(lambda s: [(0.2,), (0.6,)], lambda a: (0.3,), proportional=False, needs_table=True),
)
