"""Rates with intervals, calibration, and counts over graded cases by effect, tier, verdict and size."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.stats import binomtest

from hil.validation.proof.draw.effects import LIBRARY
from hil.validation.proof.draw.generator import TIERS
from hil.validation.proof.draw.tiers import RUNGS
from hil.validation.proof.draw.unknown_effects import NOVEL
from hil.validation.proof.score.grading import GradedCase

BINS = 10  # of confidence
Counts = Mapping[str, Mapping[str, int]]
_NOTHING = {"null": "nothing", "parameters_only": "wrong parameters"}
_OF_THE_MATRIX = ("single", "ladder", "novel", *_NOTHING)


@dataclass(frozen=True)
class Rate:
    """A count of hits among cases, with its 95 % interval."""

    hits: int
    of: int

    @property
    def value(self) -> float | None:
        """The rate; None without cases."""
        return self.hits / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval by Wilson (1927); [0, 1] without cases."""
        if not self.of:
            return 0.0, 1.0
        found = binomtest(self.hits, self.of).proportion_ci(0.95, method="wilson")
        # rounding may exclude the rate itself
        return min(float(found.low), self.hits / self.of), max(float(found.high), self.hits / self.of)


@dataclass(frozen=True)
class ConfidenceBin:
    """Findings of similar confidence: their mean confidence and the rate of right ones."""

    confidence: float
    right: Rate


@dataclass(frozen=True)
class Rung:
    """Cases of one size on the ladder."""

    size: float
    detected: Rate
    named: Rate


def rate(outcomes: Iterable[bool]) -> Rate:
    """Count the true ones."""
    found = list(outcomes)
    return Rate(sum(found), len(found))


def quantile(values: Sequence[float], part: float) -> float | None:
    """Return a quantile by nearest rank, which may be infinite; None without values."""
    return float(np.quantile(values, part, method="inverted_cdf")) if values else None


def confidence_bins(confidences: Sequence[float], right: Sequence[bool]) -> list[ConfidenceBin]:
    """Group findings by confidence in ten bins of equal width; empty bins are left out."""
    at = np.minimum((np.asarray(confidences) * BINS).astype(int), BINS - 1)
    return [
        ConfidenceBin(float(np.mean(np.asarray(confidences)[at == index])), rate(np.asarray(right)[at == index]))
        for index in range(BINS)
        if np.any(at == index)
    ]


def expected_calibration_error(bins: Sequence[ConfidenceBin]) -> float | None:
    """Return the mean difference of confidence and accuracy over findings (Naeini et al. 2015); None without any."""
    total = sum(found.right.of for found in bins)
    if not total:
        return None
    return sum(abs(found.confidence * found.right.of - found.right.hits) for found in bins) / total


def by_effect(cases: Iterable[GradedCase], hit: Callable[[GradedCase], bool]) -> dict[str, Rate]:
    """Return a rate for each effect to be found."""
    found = defaultdict[str, list[bool]](list)
    for case in cases:
        if case.concealed:
            found[case.concealed.effect].append(hit(case))
    return {effect: rate(found[effect]) for effect in sorted(found)}


def verdicts(cases: Iterable[GradedCase]) -> Counts:
    """Count verdicts by tier."""
    found = defaultdict[str, Counter[str]](Counter)
    for case in sorted(cases, key=lambda case: TIERS.index(case.truth.tier)):
        found[case.truth.tier][case.answer.verdict] += 1
    return found


def power(cases: Iterable[GradedCase]) -> list[Rung]:
    """Return detection and naming over the size of the effect, from the ladder."""
    rungs = defaultdict[float, list[GradedCase]](list)
    for case in cases:
        if case.truth.tier == "ladder":
            rungs[min(RUNGS, key=lambda size: abs(log(size / case.size)))].append(case)
    return [
        Rung(size, rate(case.detected for case in rungs[size]), rate(case.top for case in rungs[size]))
        for size in sorted(rungs)
    ]


def confusion(cases: Iterable[GradedCase]) -> Counts:
    """Count the first name, or the verdict without one, by the concealed effect, for cases with at most one.

    Two names of one law count as the concealed one; effects below the noise floor are left out.
    """
    order = [*LIBRARY, *NOVEL, *_NOTHING.values()]
    found = defaultdict[str, Counter[str]](Counter)
    for case in cases:
        if case.truth.tier in _OF_THE_MATRIX and (not case.concealed or case.above_floor):
            row = case.concealed.effect if case.concealed else _NOTHING[case.truth.tier]
            said = case.first.effect if case.first else case.answer.verdict
            found[row][row if case.top else said] += 1
    return {row: found[row] for row in sorted(found, key=order.index)}
