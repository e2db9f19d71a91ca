"""The mechanisms in a hypothesis, and which of them can act at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, count

from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Role
from hil.twin.physics import Active

Key = tuple[str, int, int]

# Periods, or orders, further apart than this factor are two causes.
_APART = 1.1
# One set: Coulomb friction that differs by direction, alike at every speed, is its band shifted by a constant torque.
SAME = FRICTION, LOAD = next((mechanism.id, mechanism.same_as) for mechanism in LIBRARY if mechanism.same_as)


@dataclass(frozen=True)
class Term:
    """A mechanism in a hypothesis, with the values it starts from; those left out at the end are the defaults."""

    effect: str
    variant: int
    values: tuple[float, ...]
    slot: int = 0  # which of those of its effect

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", BY_ID[self.effect].complete(self.values))

    @property
    def key(self) -> Key:
        """Effect, variant and slot: its own among the terms of a hypothesis."""
        return self.effect, self.variant, self.slot


def ambiguous(one: Term | Active) -> bool:
    """Whether a mechanism is one of the set that no motion tells apart."""
    return one.effect in SAME and one.variant == 0


def repeats(one: Term | Active, other: Term | Active) -> bool:
    """Whether a mechanism is another over again: the same effect and, where it has one, the same period or order; or
    the other of two that no motion tells apart."""
    if one.effect != other.effect:
        return ambiguous(one) and ambiguous(other)
    for parameter, value, other_value in zip(BY_ID[one.effect].parameters, one.values, other.values, strict=True):
        if parameter.role in (Role.PERIOD, Role.ORDER):
            return max(value, other_value) < _APART * min(value, other_value)
    return True


def free_slot(effect: str, beside: Sequence[Term]) -> int:
    """The first slot of an effect that none of its terms has."""
    used = [term.slot for term in beside if term.effect == effect]
    return next(slot for slot in count() if slot not in used)


def compatible(found: Sequence[Term | Active]) -> bool:
    """Whether mechanisms can act at once: each as often as it may, and none over again."""
    effects = [one.effect for one in found]
    return all(effects.count(effect) <= BY_ID[effect].most for effect in effects) and not any(
        repeats(one, other) for one, other in combinations(found, 2)
    )
