"""Score a proof: rates over the graded cases, beside the goals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from hil.validation.proof.answer.answers import ABSENT, Answer
from hil.validation.proof.draw.generator import TIERS, Truth
from hil.validation.proof.score.grading import GradedCase
from hil.validation.proof.score.statistics import (
    ConfidenceBin,
    Rate,
    by_effect,
    confidence_bins,
    expected_calibration_error,
    quantile,
    rate,
)

FLOORED = 1.15  # largest ratio to the noise floor of a held-out residual that counts as explained
SURE = 0.9  # confidence of a reliable finding
NO_ANSWER = Answer(ABSENT, statement="No answer was given.")


@dataclass(frozen=True)
class Goal:
    """A rate, or a number over `of` cases, beside its goal from `low` to `high`."""

    name: str
    measured: Rate | float | None
    low: float = 0.0
    high: float = inf
    of: int = 0  # cases of a number; a rate has its own
    percent: bool = True  # printed in percent
    detail: str = ""

    @property
    def value(self) -> float | None:
        """The figure; None without cases."""
        return self.measured.value if isinstance(self.measured, Rate) else self.measured

    @property
    def met(self) -> bool | None:
        """True if the goal is met; None without a goal or without cases."""
        if self.value is None or (self.low, self.high) == (0.0, inf):
            return None
        return bool(self.low <= self.value <= self.high)


@dataclass(frozen=True)
class Scores:
    """Scores of the answers of one method."""

    cases: tuple[GradedCase, ...]
    goals: tuple[Goal, ...]
    calibration: tuple[ConfidenceBin, ...]

    def of_tier(self, *tiers: str) -> list[GradedCase]:
        """Return the cases of some tiers."""
        return [case for case in self.cases if case.truth.tier in tiers]


def score(
    truths: Mapping[str, Truth], answers: Mapping[str, Answer], later: Mapping[str, Answer] | None = None
) -> Scores:
    """Score answers by case; a missing one counts as wrong. `later`: answers after the proposed motion."""
    cases = tuple(
        GradedCase(truth, answers.get(name, NO_ANSWER), (later or {}).get(name)) for name, truth in truths.items()
    )
    found = [
        (named.confidence, case.named_right(named))
        for case in cases
        for named in case.answer.named
        if named.confidence is not None
    ]
    bins = confidence_bins([confidence for confidence, _ in found], [right for _, right in found])
    return Scores(cases, tuple(_goals(cases, found, bins)), tuple(bins))


def lead(scores: Scores, others: Mapping[str, Scores]) -> Goal:
    """Return the lead in singles named first over the best other method that answered all singles."""
    singles = scores.of_tier("single")
    hits = {
        name: sum(case.top for case in other.of_tier("single"))
        for name, other in others.items()
        if {case.truth.name for case in other.of_tier("single")} == {case.truth.name for case in singles}
    }
    best = max(hits, key=lambda name: hits[name], default="")
    ahead = (sum(case.top for case in singles) - hits[best]) / len(singles) if best and singles else None
    return Goal("ahead of the best other method", ahead, low=0.20, of=len(singles), detail=best)


def _goals(
    cases: Sequence[GradedCase], found: Sequence[tuple[float, bool]], bins: Sequence[ConfidenceBin]
) -> list[Goal]:
    """Return all goals with their figures; `found`: confidence of each finding and whether it is right."""
    tier = {name: [case for case in cases if case.truth.tier == name] for name in TIERS}
    nulls, wrong, singles, pairs = tier["null"], tier["parameters_only"], tier["single"], tier["pair"]
    novel, ambiguous, poor, less = tier["novel"], tier["ambiguous"], tier["insufficient"], tier["less_known"]
    effects = by_effect(singles, lambda case: case.top)
    worst = min(effects, key=lambda effect: effects[effect].value or 0.0, default="")
    right = [case for case in singles if case.top]
    errors = [error for case in right for error in case.parameter_errors().values()]
    ratios = [case.answer.over_floor for case in right if case.answer.over_floor is not None]
    nominal = [error for case in wrong for error in case.nominal_errors().values()]
    calibration_error = expected_calibration_error(bins)
    return [
        Goal("nulls: something named", rate(case.names_something for case in nulls), high=0.01),
        Goal("nulls: right verdict", rate(case.right for case in nulls)),
        Goal("wrong parameters: something named", rate(case.names_something for case in wrong), high=0.02),
        Goal("wrong parameters: right verdict", rate(case.right for case in wrong)),
        Goal("detected where above the floor", rate(case.detected for case in cases if case.above_floor), low=0.95),
        Goal("singles: named first", rate(case.top for case in singles), low=0.92),
        Goal("singles: in the set named first", rate(case.in_set for case in singles), low=0.99),
        Goal("singles: more in that set", rate(case.blurred for case in singles)),
        Goal("singles: worst effect", effects.get(worst), low=0.80, detail=worst),
        Goal("singles: a spurious second", rate(case.names_too_much for case in singles)),
        Goal("pairs: both named", rate(all(case.matched) for case in pairs), low=0.80),
        Goal("pairs: at least one named", rate(any(case.matched) for case in pairs), low=0.98),
        Goal("pairs: a spurious third", rate(case.names_too_much for case in pairs), high=0.05),
        Goal("masked: what hides is named", rate(bool(case.matched[0]) for case in tier["masked"])),
        Goal("block right", rate(case.block_right for case in singles), low=0.95),
        _median("window overlap, median IoU", [case.window_overlap() for case in singles], low=0.8, percent=False),
        _median("spatial period, median error", [case.period_error() for case in singles], high=0.002),
        _median("mode frequency, median error", [case.frequency_error() for case in singles], high=0.01),
        _median("parameters, median error", errors, high=0.03),
        Goal("parameters, 90th percentile", quantile(errors, 0.9), high=0.10, of=len(errors)),
        Goal(
            "parameters, 90 % intervals cover",
            rate(held for case in right for held in case.covered().values()),
            low=0.86,
            high=0.94,
        ),
        Goal(f"held out ≤ {FLOORED} × floor if right", rate(ratio <= FLOORED for ratio in ratios), low=0.90),
        _median("parameters of the bench, median", nominal),
        Goal("confidence: calibration error", calibration_error, high=0.05, of=len(found), percent=False),
        Goal(f"right where confidence ≥ {SURE}", rate(good for sure, good in found if sure >= SURE), low=0.95),
        Goal("novel: unexplained", rate(case.right for case in novel), low=0.90),
        Goal("novel: something named", rate(case.names_too_much for case in novel), high=0.05),
        Goal("novel: block right", rate(case.block_right for case in novel)),
        Goal("ambiguous: reported as a set", rate(case.set_reported for case in ambiguous), low=0.95),
        Goal("ambiguous: more in that set", rate(case.blurred for case in ambiguous)),
        Goal("ambiguous: resolved by motion", rate(case.resolved for case in ambiguous), low=0.90),
        Goal("insufficient: called not testable", rate(case.called_untestable for case in poor)),
        Goal("insufficient: something named", rate(case.names_something for case in poor)),
        Goal("less known: named or not testable", rate(case.top or case.called_untestable for case in less), low=0.90),
        Goal("less known: a spurious name", rate(case.names_too_much for case in less)),
    ]


def _median(
    name: str, values: Iterable[float | None], low: float = 0.0, high: float = inf, percent: bool = True
) -> Goal:
    known = [value for value in values if value is not None]
    return Goal(name, quantile(known, 0.5), low, high, len(known), percent)
