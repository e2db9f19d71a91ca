"""Table-side viscous friction: the guideway takes another share of the viscous friction than of Coulomb friction."""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _more_on_table(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    more = parameters[0]
    return value + more * (1.0 - value if more > 0.0 else value)  # from none of it at -1 to all of it at 1


MECHANISM = Mechanism(
    id="table_side_viscous_friction",
    block=Block.TABLE,
    element="guideways",
    equation="F_table = s Fc sign(v) + s' Fv v; s' = s + d (1 - s) for d > 0, s + d s for d < 0; F_motor = F - F_table",
    source="Altintas, Verl, Brecher, Uriarte and Pritschow, Machine tool feed drives, CIRP Annals 60 (2011) 779",
    parameters=(Parameter("share", Dimension.RATIO, -1.0, 1.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.TABLE_VISCOUS_SHARE, _more_on_table),),
    text=Text(
        "The share of the viscous friction on the motor is {share} less than that of Coulomb friction.",
        Picture.LOST_MOTION,
        reversed="The share of the viscous friction on the table is {share} less than that of Coulomb friction.",
    ),
    search=SearchHints(lambda s: [(0.1,), (-0.1,)], lambda a: (0.5,), needs_table=True),
)
