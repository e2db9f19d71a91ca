"""Mechanisms in a hypothesis, and the rules by which they are compatible."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, count

from hil.twin.library import BY_ID, LIBRARY
from hil.twin.parameter import Role
from hil.twin.physics import Active

Key = tuple[str, int, int]

# Periods (or orders) further apart than this factor are two causes: a travel of ten periods resolves 10 %.
_APART = 1.1
# Equal on every motion: direction-dependent Coulomb friction is symmetric friction plus a constant torque.
SAME = FRICTION, LOAD = next((mechanism.id, mechanism.same_as) for mechanism in LIBRARY if mechanism.same_as)


@dataclass(frozen=True)
class Term:
    """A mechanism in a hypothesis, with its starting values; missing ones at the end are the defaults."""

    effect: str
    variant: int
    values: tuple[float, ...]
    slot: int = 0  # number among the terms of the same effect

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", BY_ID[self.effect].complete(self.values))

    @property
    def key(self) -> Key:
        """Effect, variant and slot: unique among the terms of a hypothesis."""
        return self.effect, self.variant, self.slot


def ambiguous(one: Term | Active) -> bool:
    """True for constant load and asymmetric Coulomb friction, which no motion distinguishes."""
    return one.effect in SAME and one.variant == 0


def repeats(one: Term | Active, other: Term | Active) -> bool:
    """True if two mechanisms are the same: equal effect and period or order, or both `ambiguous`."""
    if one.effect != other.effect:
        return ambiguous(one) and ambiguous(other)
    for parameter, value, other_value in zip(BY_ID[one.effect].parameters, one.values, other.values, strict=True):
        if parameter.role in (Role.PERIOD, Role.ORDER):
            return max(value, other_value) < _APART * min(value, other_value)
    return True


def free_slot(effect: str, beside: Sequence[Term]) -> int:
    """Return the first unused slot of an effect."""
    used = [term.slot for term in beside if term.effect == effect]
    return next(slot for slot in count() if slot not in used)


def compatible(found: Sequence[Term | Active]) -> bool:
    """True if mechanisms can act at once: none more often than allowed and none repeated."""
    effects = [one.effect for one in found]
    return all(effects.count(effect) <= BY_ID[effect].most for effect in effects) and not any(
        repeats(one, other) for one, other in combinations(found, 2)
    )
