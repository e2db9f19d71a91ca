"""Position-dependent stiffness: the screw is stiffer or softer with the position of its nut."""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _stiffness_along_travel(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value * max(1.0 + parameters[0] * at.table_position_m, 0.0)


MECHANISM = Mechanism(
    id="position_dependent_stiffness",
    block=Block.TRANSMISSION,
    element="screw between bearing and nut",
    equation="T = k max(1 + s x, 0) q,   k: torsion and axial give of the screw, one after the other",
    source="Zaeh, Oertli and Milberg, CIRP Annals 53 (2004) 289, screw stiffness over the position of its nut",
    parameters=(Parameter("relative_slope", Dimension.PER_LENGTH, -10.0, 10.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.SCREW, _stiffness_along_travel),),
    text=Text(
        "The stiffness of the screw changes by a share of {relative_slope} for each metre of travel.", Picture.STIFFNESS
    ),
    search=SearchHints(typical=lambda a: (0.5,)),
    softens=True,
)
