"""Score a proof on real recordings.

What the diagnosis names on the untouched half is there already: beside a concealed effect it is neither right nor
false. On untouched halves a name is false unless the other half of the same recording, diagnosed apart, has it too.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot

from hil.twin.library import LIBRARY, names_of
from hil.twin.parameter import Role
from hil.validation.proof.answer.answers import FAILED, Answer, Named
from hil.validation.proof.conceal.cases import RealTruth
from hil.validation.proof.score.grading import NORMAL_90, difference
from hil.validation.proof.score.scores import Goal
from hil.validation.proof.score.statistics import Rate, confidence_bins, expected_calibration_error, rate

TOLD = 5.0  # standard errors of least squares from which the diagnosis should name an effect
SURE, LIKELY = 0.9, 0.5  # confidence of a name
_SOON = 0.1  # of a half: largest difference of two moments that are one
_NEAR = 0.1  # relative difference of two periods, orders or frequencies that are one


@dataclass(frozen=True)
class RealCaseScore:
    """A case with its answer; `untouched` is that on the same half without an edit, `other_half` on the other half."""

    truth: RealTruth
    answer: Answer
    untouched: Answer
    other_half: Answer

    @property
    def unanswered(self) -> bool:
        """True if the diagnosis failed."""
        return self.answer.verdict == FAILED

    @property
    def null(self) -> bool:
        """True for an untouched half."""
        return not self.truth.kind

    @property
    def there_already(self) -> bool:
        """True if the untouched half has the name of the concealed effect: a name proves nothing."""
        return any(self._names(one, frozenset({one.effect})) for one in self.untouched.named)

    @cached_property
    def new(self) -> tuple[Named, ...]:
        """Names that are not there already; on an untouched half those that the other half does not confirm."""
        before = self.other_half if self.null else self.untouched
        return tuple(named for named in self.answer.named if not any(alike(named, one) for one in before.named))

    @property
    def first_right(self) -> bool:
        """True if the first new name is that of the concealed effect."""
        return bool(self.new) and self._names(self.new[0], frozenset({self.new[0].effect}))

    @property
    def in_set(self) -> bool:
        """True if the first new name or one of its equivalents is that of the concealed effect."""
        return bool(self.new) and self.right(self.new[0])

    @property
    def detected(self) -> bool:
        """True if the answer has a new name, or says that something is missing where it did not before."""
        verdicts = ("missing_physics", "unexplained", "axis_changed")
        return bool(self.new) or (self.answer.verdict in verdicts and self.untouched.verdict not in verdicts)

    @property
    def moment_told(self) -> bool:
        """True if the answer is a change of the axis, near the moment of the concealed one."""
        told, true = self.answer.moment_s, self.truth.moment_s
        near = told is not None and true is not None and abs(told - true) <= _SOON * self.truth.duration_s
        return near and self.answer.verdict == "axis_changed"

    def right(self, named: Named) -> bool:
        """Return whether a new name is right, by itself or by an equivalent that the diagnosis gives beside it."""
        return self._names(named, named.reported)

    def _names(self, named: Named, reported: frozenset[str]) -> bool:
        """Return whether ids that a finding reports are right, and its place is that of the concealed effect."""
        return bool(reported & set(self.truth.right)) and same_place(_values(named), self.truth.parameters)

    @property
    def wrong(self) -> tuple[Named, ...]:
        """New names that are wrong."""
        return tuple(named for named in self.new if not self.right(named))

    def wrong_above(self, confidence: float) -> bool:
        """Return whether a wrong new name has more than a confidence."""
        return any((named.confidence or 0.0) > confidence for named in self.wrong)

    def covered(self) -> dict[str, bool]:
        """Return whether the 90 % interval of each known parameter of the right name covers its true value.

        Of an effect that was there already it is the change that is compared, with the errors of both answers.
        """
        names = (one for one in self.answer.named if self._names(one, frozenset({one.effect})))
        found = next(names, None)
        if found is None or (self.there_already and not self.truth.adds):
            return {}
        before = next((one for one in self.untouched.named if one.effect == found.effect and alike(one, found)), None)
        held = {}
        for name, true in self.truth.compared.items():
            if name in found.parameters:
                value, error = found.parameters[name]
                value_0, error_0 = before.parameters.get(name, (0.0, 0.0)) if before is not None else (0.0, 0.0)
                held[name] = difference(name, value - value_0, true) <= NORMAL_90 * hypot(error, error_0)
        return held

    def as_json(self) -> dict[str, object]:
        """Return plain data for scores.json."""
        names = [{"effect": one.effect, "confidence": one.confidence, "right": self.right(one)} for one in self.new]
        return {
            **self.truth.as_json(),
            "verdict": self.answer.verdict,
            "statement": self.answer.statement,
            "new_names": names,
            "there_already": [named.effect for named in self.untouched.named],
            "first_right": self.first_right,
            "detected": self.detected,
            "covered": self.covered(),
            "runtime_s": self.answer.runtime_s,
        }


@dataclass(frozen=True)
class RealScores:
    """Graded cases and the figures over them."""

    cases: tuple[RealCaseScore, ...]
    goals: tuple[Goal, ...]


def same_laws(effect: str) -> frozenset[str]:
    """Return the ids of the library for the torque of this effect on every motion, with its own."""
    same = {one.id for one in LIBRARY if one.same_torque(0) == effect}
    own = {one.same_torque(0) for one in LIBRARY if one.id == effect} - {""}
    return frozenset({effect, *same, *own})


def alike(one: Named, other: Named) -> bool:
    """Return whether two findings are one effect: the same law at the same place."""
    return one.effect in same_laws(other.effect) and same_place(_values(one), _values(other))


def same_place(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Return whether orders, periods and frequencies that both have agree, and their windows of time overlap."""
    shared = [
        name for name in names_of(Role.ORDER, Role.PERIOD, Role.LINE, Role.FREQUENCY) if name in one and name in other
    ]
    windows = [[values[name] for name in names_of(Role.EDGE) if name in values] for values in (one, other)]
    apart = all(windows) and max(window[0] for window in windows) >= min(window[-1] for window in windows)
    return not apart and all(abs(one[name] - other[name]) <= _NEAR * abs(other[name]) for name in shared)


def _values(named: Named) -> dict[str, float]:
    return {name: value for name, (value, _) in named.parameters.items()}


def score_real(truths: Mapping[str, RealTruth], answers: Mapping[str, Answer]) -> RealScores:
    """Score the answers to cases of which both untouched halves have one too."""
    nulls = {truth.half: answers[name] for name, truth in truths.items() if not truth.kind and name in answers}
    cases = []
    for name, truth in truths.items():
        source, part, law_known = truth.half
        untouched, other_half = nulls.get(truth.half), nulls.get((source, 1 - part, law_known))
        if name in answers and untouched is not None and other_half is not None:
            cases.append(RealCaseScore(truth, answers[name], untouched, other_half))
    return RealScores(tuple(cases), tuple(_goals(cases)))


def _goals(cases: Sequence[RealCaseScore]) -> list[Goal]:
    """Return all goals with their figures."""
    nulls = [case for case in cases if case.null]
    concealed = [case for case in cases if case.truth.right]
    named = [case for case in concealed if not case.there_already]
    told = [case for case in named if case.truth.size >= TOLD]
    moved = [case for case in cases if case.truth.moment_s is not None and case.truth.size >= TOLD]
    unknown = [case for case in cases if case.truth.shape_missing]
    harmless = [case for case in cases if not (case.null or case.truth.right or case.truth.shape_missing)]
    edited = [case for case in cases if not case.null]
    found = [(one.confidence, case.right(one)) for case in cases for one in case.new if one.confidence is not None]
    bins = confidence_bins([confidence for confidence, _ in found], [right for _, right in found])
    error = expected_calibration_error(bins)
    return [
        Goal("untouched: named in one half only", rate(bool(case.new) or case.unanswered for case in nulls), high=0.05),
        Goal("untouched: something named", rate(bool(case.answer.named) for case in nulls)),
        Goal(f"told by {TOLD:g} errors: named first", rate(case.first_right for case in told), low=0.85),
        Goal(f"told by {TOLD:g} errors: in the set named first", rate(case.in_set for case in told)),
        Goal(f"told by {TOLD:g} errors: detected", rate(case.detected for case in told)),
        Goal("told by less: named first", rate(case.first_right for case in named if case.truth.size < TOLD)),
        Goal("name there already", rate(case.there_already for case in concealed)),
        Goal(f"wrong name above {SURE}", rate(case.wrong_above(SURE) for case in edited), high=0.02),
        Goal(f"wrong name above {LIKELY}", rate(case.wrong_above(LIKELY) for case in edited), high=0.05),
        Goal("no name for it: something named", rate(bool(case.new) or case.unanswered for case in unknown)),
        Goal("no name for it: detected", rate(case.detected for case in unknown)),
        Goal(f"changes told by {TOLD:g} errors: their moment", rate(case.moment_told for case in moved)),
        Goal("nothing missing: something named", rate(bool(case.new) or case.unanswered for case in harmless)),
        Goal("parameters, 90 % intervals cover", _covered(concealed), low=0.85, high=0.95),
        Goal("confidence: calibration error", error, high=0.07, of=len(found), percent=False),
        Goal("no answer", rate(case.unanswered for case in cases)),
    ]


def _covered(cases: Iterable[RealCaseScore]) -> Rate:
    return rate(held for case in cases for held in case.covered().values())
