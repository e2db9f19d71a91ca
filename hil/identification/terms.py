"""Mechanisms in a hypothesis, and the rules by which they are compatible."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, count
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Stage
from hil.twin.parameter import Role
from hil.twin.physics import Active

Key = tuple[str, int, int]

# Periods (or orders) further apart than this factor are two causes: a travel of ten periods resolves 10 %.
_APART = 1.1
# Frequent and rare cause of a torque that is the same on every motion, each in its first variant.
_SAME = tuple((mechanism.id, rarer) for mechanism in LIBRARY if (rarer := mechanism.same_torque(0)))


class Window(NamedTuple):
    """An event in one run: start and end later, and strength larger, than the values of its term."""

    run: str  # its name
    later_s: float = 0.0
    end_later_s: float = 0.0
    factor: float = 1.0


@dataclass(frozen=True)
class Term:
    """A mechanism in a hypothesis, with its starting values; missing ones at the end are the defaults.

    A transient mechanism acts in its `windows` only; without any it acts at its values in every run.
    """

    effect: str
    variant: int
    values: tuple[float, ...]
    slot: int = 0  # number among the terms of the same effect
    windows: tuple[Window, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", BY_ID[self.effect].complete(self.values))

    @property
    def key(self) -> Key:
        """Effect, variant and slot: unique among the terms of a hypothesis."""
        return self.effect, self.variant, self.slot

    @property
    def free(self) -> int:
        """Number of free values: those of the mechanism, for each window."""
        return len(self.values) * max(len(self.windows), 1)

    def at(self, window: Window) -> tuple[float, ...]:
        """Values of the mechanism in a window."""
        mechanism, values = BY_ID[self.effect], list(self.values)
        values[mechanism.strength] *= window.factor
        start, end = mechanism.indices(Role.EDGE)
        values[start] += window.later_s
        values[end] += window.end_later_s
        return tuple(values)

    def edges(self, window: Window) -> tuple[float, float]:
        """Start and end [s] of a window."""
        values = self.at(window)
        start, end = (values[index] for index in BY_ID[self.effect].indices(Role.EDGE))
        return start, end

    def windows_of(self, run: str) -> list[tuple[float, ...]]:
        """Values of the mechanism in each window of a run."""
        return [self.at(window) for window in self.windows if window.run == run]


def push_n(terms: Sequence[Term], run: str, time_s: FloatArray, period_s: float) -> FloatArray:
    """Force on the table [N] of the events of a run, mean over each tick (n,); empty without events."""
    push = np.empty(0)
    for term in terms:
        over_time = BY_ID[term.effect].over_time
        if over_time is None:
            continue
        for window in term.windows:
            if window.run == run:
                push = push if push.size else np.zeros(time_s.size)
                start_s, end_s = term.edges(window)
                rows = slice(*np.searchsorted(time_s, (start_s - period_s, end_s)))  # there may be hundreds of windows
                push[rows] += over_time(time_s[rows], period_s, term.at(window))
    return push


def same_torque(one: Term | Active) -> tuple[str, ...]:
    """Frequent and rare cause that no motion distinguishes, of which this is one; empty for any other mechanism."""
    return next((pair for pair in _SAME if one.effect in pair and one.variant == 0), ())


def ambiguous(one: Term | Active, other: Term | Active | None = None) -> bool:
    """True if another mechanism has the same torque on every motion: `other`, or any."""
    pair = same_torque(one)
    return bool(pair) and (other is None or pair == same_torque(other))


def is_frequent(one: Term | Active) -> bool:
    """True for the frequent one of two causes that no motion distinguishes."""
    return one.effect in same_torque(one)[:1]


def is_load(term: Term) -> bool:
    """True for a force that does not depend on the speed: an event, a weight, a spring, gravity."""
    return ambiguous(term) or BY_ID[term.effect].variants[term.variant].stage is Stage.TABLE_FORCE


def repeats(one: Term | Active, other: Term | Active) -> bool:
    """True if two mechanisms are the same: equal effect and period, order or, without these, variant; or both
    the same torque."""
    if one.effect != other.effect:
        return ambiguous(one, other)
    for parameter, value, other_value in zip(BY_ID[one.effect].parameters, one.values, other.values, strict=True):
        if parameter.role in (Role.PERIOD, Role.ORDER):
            return max(value, other_value) < _APART * min(value, other_value)
    return BY_ID[one.effect].most == 1 or one.variant == other.variant


def free_slot(effect: str, beside: Sequence[Term]) -> int:
    """Return the first unused slot of an effect."""
    used = [term.slot for term in beside if term.effect == effect]
    return next(slot for slot in count() if slot not in used)


def compatible(mechanisms: Sequence[Term | Active]) -> bool:
    """True if mechanisms can act at once: none more often than allowed and none repeated."""
    effects = [one.effect for one in mechanisms]
    return all(effects.count(effect) <= BY_ID[effect].most for effect in effects) and not any(
        repeats(one, other) for one, other in combinations(mechanisms, 2)
    )


def effects(terms: Sequence[Term]) -> list[tuple[str, int]]:
    """Effect and variant of each term, in alphabetical order."""
    return sorted((term.effect, term.variant) for term in terms)


def within_a_turn(term: Term) -> Term:
    """The term with its phases reduced to one turn."""
    values = tuple(
        math.remainder(value, 2.0 * math.pi) if parameter.role is Role.PHASE else value
        for value, parameter in zip(term.values, BY_ID[term.effect].parameters, strict=True)
    )
    return replace(term, values=values)
