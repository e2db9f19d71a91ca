"""The score of a proof: rates over the marked cases, beside the goals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from hil.proof.answer.answers import ABSENT, Reply
from hil.proof.draw.generator import Truth
from hil.proof.score.confusion import by_effect
from hil.proof.score.grading import Marked
from hil.proof.score.statistics import (
    ConfidenceBin,
    Rate,
    confidence_bins,
    expected_calibration_error,
    quantile,
    rate,
)

FLOORED = 1.15  # times the noise floor, up to which a held-out residual is down to it
SURE = 0.9  # confidence that may be relied on
NO_REPLY = Reply(ABSENT, statement="No answer was given.")


@dataclass(frozen=True)
class Goal:
    """A figure beside its goal: a rate, or a number of so many cases. `low` and `high` are what is wanted."""

    name: str
    measured: Rate | float | None
    low: float = 0.0
    high: float = inf
    of: int = 0  # cases behind a number; a rate has its own
    percent: bool = True  # how it is read
    detail: str = ""

    @property
    def value(self) -> float | None:
        """The figure; None where no case tells it."""
        return self.measured.value if isinstance(self.measured, Rate) else self.measured

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None where no case tells it or there is none."""
        if self.value is None or (self.low, self.high) == (0.0, inf):
            return None
        return bool(self.low <= self.value <= self.high)


@dataclass(frozen=True)
class Scores:
    """All that is scored of the answers of one method."""

    cases: tuple[Marked, ...]
    goals: tuple[Goal, ...]
    calibration: tuple[ConfidenceBin, ...]

    def of_tier(self, *tiers: str) -> list[Marked]:
        """Cases of some tiers."""
        return [case for case in self.cases if case.truth.tier in tiers]


def score(
    truths: Mapping[str, Truth], replies: Mapping[str, Reply], later: Mapping[str, Reply] | None = None
) -> Scores:
    """Score answers by case; one that is wanting counts as wrong. `later` are those after the motion asked for."""
    cases = tuple(Marked(truth, replies.get(name, NO_REPLY), (later or {}).get(name)) for name, truth in truths.items())
    bins = calibration(cases)
    return Scores(
        cases,
        (*_named(cases), *_located(cases), *_modelled(cases), *_sure(cases, bins), *_abstained(cases)),
        tuple(bins),
    )


def lead(scores: Scores, others: Mapping[str, Scores]) -> Goal:
    """Points of the rate of singles named first by which a method is ahead of the best of the others, of those that
    answered all singles."""
    singles = scores.of_tier("single")
    hits = {
        name: sum(case.top for case in other.of_tier("single"))
        for name, other in others.items()
        if {case.truth.name for case in other.of_tier("single")} == {case.truth.name for case in singles}
    }
    best = max(hits, key=lambda name: hits[name], default="")
    ahead = (sum(case.top for case in singles) - hits[best]) / len(singles) if best and singles else None
    return Goal("ahead of the best other method", ahead, low=0.20, of=len(singles), detail=best)


def calibration(cases: Iterable[Marked]) -> list[ConfidenceBin]:
    """Confidence of every finding against whether it is there."""
    found = _confidences(cases)
    return confidence_bins([confidence for confidence, _ in found], [right for _, right in found])


def _named(cases: Sequence[Marked]) -> list[Goal]:
    singles, pairs = _tier(cases, "single"), _tier(cases, "pair")
    above = [case for case in cases if case.above_floor]
    effects = by_effect(singles, lambda case: case.top)
    worst = min(effects, key=lambda effect: effects[effect].value or 0.0, default="")
    nulls, wrong = _tier(cases, "null"), _tier(cases, "parameters_only")
    return [
        Goal("nulls: something named", rate(case.names_something for case in nulls), high=0.01),
        Goal("nulls: right verdict", rate(case.right for case in nulls)),
        Goal("wrong parameters: something named", rate(case.names_something for case in wrong), high=0.02),
        Goal("wrong parameters: right verdict", rate(case.right for case in wrong)),
        Goal("detected where above the floor", rate(case.detected for case in above), low=0.95),
        Goal("singles: named first", rate(case.top for case in singles), low=0.92),
        Goal("singles: in the set named first", rate(case.in_set for case in singles), low=0.99),
        Goal("singles: more in that set", rate(case.blurred for case in singles)),
        Goal("singles: worst effect", effects.get(worst), low=0.80, detail=worst),
        Goal("singles: a spurious second", rate(case.names_too_much for case in singles)),
        Goal("pairs: both named", rate(all(case.matched) for case in pairs), low=0.80),
        Goal("pairs: at least one named", rate(any(case.matched) for case in pairs), low=0.98),
        Goal("pairs: a spurious third", rate(case.names_too_much for case in pairs), high=0.05),
        Goal("masked: what hides is named", rate(bool(case.matched[0]) for case in _tier(cases, "masked"))),
    ]


def _located(cases: Sequence[Marked]) -> list[Goal]:
    singles = _tier(cases, "single")
    return [
        Goal("block right", rate(case.block_right for case in singles), low=0.95),
        _median("window overlap, median IoU", [case.window_overlap() for case in singles], low=0.8, percent=False),
        _median("spatial period, median error", [case.period_error() for case in singles], high=0.002),
        _median("mode frequency, median error", [case.frequency_error() for case in singles], high=0.01),
    ]


def _modelled(cases: Sequence[Marked]) -> list[Goal]:
    named = [case for case in _tier(cases, "single") if case.top]
    errors = [error for case in named for error in case.parameter_errors().values()]
    covered = rate(held for case in named for held in case.covered().values())
    ratios = [case.reply.over_floor for case in named if case.reply.over_floor is not None]
    nominal = [error for case in _tier(cases, "parameters_only") for error in case.nominal_errors().values()]
    return [
        _median("parameters, median error", errors, high=0.03),
        Goal("parameters, 90th percentile", quantile(errors, 0.9), high=0.10, of=len(errors)),
        Goal("parameters, 90 % intervals cover", covered, low=0.86, high=0.94),
        Goal(f"held out ≤ {FLOORED} × floor if right", rate(ratio <= FLOORED for ratio in ratios), low=0.90),
        _median("parameters of the bench, median", nominal),
    ]


def _sure(cases: Sequence[Marked], bins: Sequence[ConfidenceBin]) -> list[Goal]:
    found = _confidences(cases)
    return [
        Goal(
            "confidence: calibration error", expected_calibration_error(bins), high=0.05, of=len(found), percent=False
        ),
        Goal(f"right where confidence ≥ {SURE}", rate(right for sure, right in found if sure >= SURE), low=0.95),
    ]


def _abstained(cases: Sequence[Marked]) -> list[Goal]:
    novel, poor = _tier(cases, "novel"), _tier(cases, "insufficient")
    return [
        Goal("novel: unexplained", rate(case.reply.verdict == "unexplained" for case in novel), low=0.90),
        Goal("novel: something named", rate(case.names_something for case in novel), high=0.05),
        Goal("novel: block right", rate(case.block_right for case in novel)),
        Goal("ambiguous: reported as a set", rate(case.set_reported for case in _tier(cases, "ambiguous")), low=0.95),
        Goal("ambiguous: more in that set", rate(case.blurred for case in _tier(cases, "ambiguous"))),
        Goal("ambiguous: resolved by motion", rate(case.resolved for case in _tier(cases, "ambiguous")), low=0.90),
        Goal("insufficient: called not testable", rate(case.called_untestable for case in poor)),
        Goal("insufficient: something named", rate(case.names_something for case in poor)),
    ]


def _confidences(cases: Iterable[Marked]) -> list[tuple[float, bool]]:
    return [
        (named.confidence, case.named_right(named))
        for case in cases
        for named in case.reply.named
        if named.confidence is not None
    ]


def _tier(cases: Iterable[Marked], tier: str) -> list[Marked]:
    return [case for case in cases if case.truth.tier == tier]


def _median(
    name: str, values: Iterable[float | None], low: float = 0.0, high: float = inf, percent: bool = True
) -> Goal:
    known = [value for value in values if value is not None]
    return Goal(name, quantile(known, 0.5), low, high, len(known), percent)
