"""Counts over marked cases: by effect, by tier and verdict, by size, and what was taken for what."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import log

from hil.proof.draw.effects import LIBRARY
from hil.proof.draw.generator import TIERS
from hil.proof.draw.tiers import RUNGS
from hil.proof.draw.unknown_effects import NOVEL
from hil.proof.score.grading import Marked
from hil.proof.score.statistics import Rate, rate

Counts = dict[str, dict[str, int]]
_NOTHING = {"null": "nothing", "parameters_only": "wrong parameters"}
_OF_THE_MATRIX = ("single", "ladder", "novel", *_NOTHING)


@dataclass(frozen=True)
class Rung:
    """Cases of one size on the ladder."""

    size: float
    detected: Rate
    named: Rate


def by_effect(cases: Iterable[Marked], hit: Callable[[Marked], bool]) -> dict[str, Rate]:
    """A rate for each concealed effect."""
    found: dict[str, list[bool]] = {}
    for case in cases:
        if case.concealed:
            found.setdefault(case.concealed.effect, []).append(hit(case))
    return {effect: rate(found[effect]) for effect in sorted(found)}


def verdicts(cases: Iterable[Marked]) -> Counts:
    """How often each verdict was given, by tier."""
    found: Counts = {}
    for case in sorted(cases, key=lambda case: TIERS.index(case.truth.tier)):
        _count(found, case.truth.tier, case.reply.verdict)
    return found


def power(cases: Iterable[Marked]) -> list[Rung]:
    """Detection and naming over the size of the effect, from the ladder."""
    rungs: dict[float, list[Marked]] = {}
    for case in cases:
        if case.truth.tier == "ladder":
            rungs.setdefault(min(RUNGS, key=lambda size: abs(log(size / case.size))), []).append(case)
    return [
        Rung(size, rate(case.detected for case in rungs[size]), rate(case.top for case in rungs[size]))
        for size in sorted(rungs)
    ]


def confusion(cases: Iterable[Marked]) -> Counts:
    """What was named first, or the verdict without a name, by what is concealed, where that is one thing or nothing.

    Two names for one law count as the concealed one; what is below the floor is left out.
    """
    order = [*LIBRARY, *NOVEL, *_NOTHING.values()]
    found: Counts = {}
    for case in cases:
        if case.truth.tier in _OF_THE_MATRIX and (not case.concealed or case.above_floor):
            row = case.concealed.effect if case.concealed else _NOTHING[case.truth.tier]
            said = case.first.effect if case.first else case.reply.verdict
            _count(found, row, row if case.top else said)
    return {row: found[row] for row in sorted(found, key=order.index)}


def _count(counts: Counts, row: str, column: str) -> None:
    line = counts.setdefault(row, {})
    line[column] = line.get(column, 0) + 1
