"""Unit of a speed set-point, by its factor to the derivative of the position set-point."""

from hil.importing.map_file import ChannelSource
from hil.importing.relations import Relation
from hil.importing.unit_choice import ANGULAR_SPEEDS, LINEAR_SPEEDS
from hil.quantities import si_factor

FOLLOWS = 0.9  # share from which a speed is the derivative of the set-point
_SAME = 0.1  # deviation of a speed from that derivative: a following error is below, other units are far


def speed_unit(told: str | None, relation: Relation, position: ChannelSource, lead_m: float | None) -> str | None:
    """Unit of a speed = `relation` x the derivative of a `position`; None if none, or not the `told` one, fits."""
    si, size = next((si, size) for si in ("m", "rad") if (size := position.factor_to(si, None)) is not None)
    own, others = (LINEAR_SPEEDS, ANGULAR_SPEEDS) if si == "m" else (ANGULAR_SPEEDS, LINEAR_SPEEDS)
    for unit in [told] if told else [*own, *others]:
        factor = si_factor(unit, f"{si}/s", lead_m)
        fits = factor is not None and abs(abs(factor * relation.factor / size) - 1.0) < _SAME
        if fits or (factor is not None and told and relation.share < FOLLOWS):
            return unit
    return None
