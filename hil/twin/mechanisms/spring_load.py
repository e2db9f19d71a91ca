"""Spring load: a force on the table proportional to its position."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from numba import njit

from hil.twin.mechanism import Block, Dimension, Mechanism, Moment, Parameter, Stage


@njit
def _pull_to_rest(value: float, at: Moment, parameters: Sequence[float], memory: MutableSequence[float]) -> float:
    return value - parameters[0] * (at.table_position_m - parameters[1])


MECHANISM = Mechanism(
    id="spring_load",
    block=Block.TABLE,
    element="cable chain, hoses or counterbalance",
    sentence="A spring of {stiffness_n_m} pulls the table towards {rest_position_m}.",
    equation="F_table = -k (x - x0)",
    source="Hooke's law; Groß, Hamann and Wiegärtner, Electrical Feed Drives in Automation (2001), load forces",
    parameters=(
        Parameter("stiffness_n_m", Dimension.STIFFNESS, 0.0, 1e7),
        Parameter("rest_position_m", Dimension.LENGTH, -10.0, 10.0),
    ),
    stage=Stage.TABLE_FORCE,
    contribution=_pull_to_rest,
)
