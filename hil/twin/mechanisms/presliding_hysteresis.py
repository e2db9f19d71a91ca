"""Presliding hysteresis: elastic micro-motion of the contact before it slides.

Where a share of the friction acts on the table, the same share of the stiffness does.
"""

import math

from numba import njit

from hil.twin.mechanism import Block, Contact, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture


@njit
def _contact_stiffness(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return value + parameters[0]


MECHANISM = Mechanism(
    id="presliding_hysteresis",
    block=Block.MOTOR_SIDE,
    element="ball nut and guideways",
    equation="F = sigma z, dz/dt = v (1 - sigma z sign(v) / F(v)); Maxwell slip: F = sum of f_i, df_i/dt = k_i v while "
    "|f_i| < y_i",
    source="Dahl, A solid friction model (1968); Canudas de Wit et al., IEEE Trans. Automatic Control 40 (1995) 419; "
    "Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control 50 (2005) 1883",
    parameters=(Parameter("stiffness_n_m_rad", Dimension.MOTOR_STIFFNESS, 1.0, 1e10, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.BRISTLE, _contact_stiffness, "Dahl"),
        Variant(
            Stage.BRISTLE,
            _contact_stiffness,
            "Maxwell slip",
            text=Text(
                "Before it slides, the contact yields like a spring of {stiffness_n_m_rad}, and like it again from "
                "wherever it turns."
            ),
            contact=Contact.SLIPS,
        ),
    ),
    text=Text("Before it slides, the contact yields like a spring of {stiffness_n_m_rad}.", Picture.FRICTION_LOOP),
    search=SearchHints(
        lambda s: [(s.coulomb * s.ratio / d,) for d in (0.3e-6, 1e-6, 4e-6, 16e-6)],
        lambda a: (a.friction * a.ratio / 5e-6,),
        proportional=False,
    ),
    neutral=lambda a: math.inf,
)
