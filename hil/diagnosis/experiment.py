"""The motion that separates what the recorded one cannot: T-optimal design (Atkinson and Fedorov 1975).

    evidence = min over a of  |J_o a|^2 + |r + J a|^2,  less the same of the truth

One hypothesis is taken as the truth: its closed loop over a candidate's set-points is a recording without noise. r are
the residuals of the other on it, block by block in units of noise, J their derivatives, J_o those on the recordings
that there are: what these have fixed is free no more. The evidence must be had whichever of the two is true.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.candidate_motions import candidates, reach
from hil.diagnosis.search.forward_selection import ALIKE, TIED, Explanation
from hil.diagnosis.verdict.findings import rivals_of
from hil.diagnosis.verdict.judge import not_testable
from hil.diagnosis.wording import title
from hil.identification.dataset import Dataset, Measured
from hil.identification.estimator import Estimator, Fit, in_parallel
from hil.identification.hypothesis import Hypothesis
from hil.identification.terms import SAME, ambiguous, compatible
from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan
from hil.quantities import digits
from hil.twin.axis import Start
from hil.twin.library import BY_ID

_SURE = 2.0  # times as visible as needed must be what a motion shows that nobody has made yet

Question = tuple[str, ...]  # two effects to be told apart, or one to be shown
Answers = Mapping[Question, float]


@dataclass(frozen=True, eq=False)
class Experiment:
    """The motion to run next, the mechanisms that it tells apart or shows, and what is expected of it in words.

    `profile` is None where no motion within the reach of the recordings answers anything.
    """

    profile: Profile | None
    separates: tuple[str, ...]
    note: str


@dataclass(frozen=True, eq=False)
class _Alternative:
    """An explanation of the recordings; `known` is R of their Jacobian J_o = Q R."""

    effect: str
    hypothesis: Hypothesis
    known: FloatArray
    estimator: Estimator

    def on(self, run: Measured) -> Fit:
        """The explanation evaluated on another run."""
        data = self.estimator.data.over([run])
        return replace(self.estimator, data=data).evaluate(self.hypothesis)


def separating(explanation: Explanation, final: Fit, held_out: Dataset) -> Experiment | None:
    """The motion that tells the terms of `final` from the rivals that the recordings tie with them; None without any.

    Of the motions that separate most of them it is the one with the most evidence per second for the hardest.
    """
    train = final.data
    pairs = [pair for index in range(len(final.terms)) for pair in permutations(_group(explanation, final, index), 2)]
    if not pairs:
        if not any(map(ambiguous, final.terms)):
            return None
        return Experiment(None, (), f"No motion tells {_pairs([SAME])}: they are the same torque on every one.")

    asked: set[Question] = {tuple(sorted((truth.effect, other.effect))) for truth, other in pairs}

    known, channels = final.rows, final.rows / train.rows

    def enough(trajectory: Trajectory) -> float:
        # beside what is recorded, the difference must be one that tells (see `Rival.tied`)
        return max(TIED, ALIKE * (known + channels * len(trajectory)))

    def answers(trajectory: Trajectory) -> Answers:
        found, least = dict.fromkeys(asked, np.inf), enough(trajectory)
        for truth, other in pairs:
            question = tuple(sorted((truth.effect, other.effect)))
            if found[question] >= least:  # not already open the other way round
                run = _imagined(truth, trajectory, train.runs[0])
                found[question] = min(found[question], _left(other, run) - _own(truth, run))
        return found

    best = _best(
        (*train.runs, *held_out.runs),
        final.hypothesis.bench,
        len(asked),
        answers,
        enough,
        lambda one: (len(one.answered), one.worth / one.duration_s),
    )
    if best is None:
        return Experiment(None, (), f"No motion within the reach of these recordings tells {_pairs(asked)}.")
    return Experiment(
        best.profile,
        best.effects,
        f"{best.what} is expected to tell {_pairs(best.answered)}, with "
        f"evidence of {digits(best.worth)} or more, where {TIED:g} is very strong.",
    )


def showing(found: Fit, hidden: Sequence[str], held_out: Dataset) -> Experiment | None:
    """The motion that shows most per second of the mechanisms that the recordings cannot show; None where all show."""
    if not hidden:
        return None
    expected = _alternative("", found)

    def answers(trajectory: Trajectory) -> Answers:
        there = expected.on(_imagined(expected, trajectory, found.data.runs[0]))
        there = replace(there, jacobian=there.estimator.jacobian(there.hypothesis))
        still = not_testable(there, hidden, _SURE)
        return {(effect,): float(effect not in still) for effect in hidden}

    best = _best(
        (*found.data.runs, *held_out.runs),
        found.hypothesis.bench,
        len(hidden),
        answers,
        lambda _: 1.0,
        lambda one: len(one.answered) / one.duration_s,
    )
    names = ", ".join(map(title, best.effects if best else hidden))
    if best is None:
        return Experiment(None, (), f"No motion within the reach of these recordings shows {names}.")
    return Experiment(best.profile, best.effects, f"{best.what} would show {names}, at a strength that matters.")


@dataclass(frozen=True, eq=False)
class _Tested:
    """A candidate, how long it takes, the questions that it answers, and what it brings for the hardest of them."""

    profile: Profile
    duration_s: float
    answered: tuple[Question, ...]
    worth: float

    @property
    def effects(self) -> tuple[str, ...]:
        """The mechanisms in question."""
        return tuple(dict.fromkeys(effect for question in self.answered for effect in question))

    @property
    def what(self) -> str:
        """The motion in words."""
        return f"A motion of {self.duration_s:.0f} s ({self.profile.description})"


def _best(
    runs: Sequence[Measured],
    bench: Bench,
    questions: int,
    answers: Callable[[Trajectory], Answers],
    enough: Callable[[Trajectory], float],
    rank: Callable[[_Tested], Any],
) -> _Tested | None:
    """The candidate of the highest rank. Long ones are tried only for what no shorter one answers."""

    def test(profile: Profile) -> _Tested:
        trajectory = plan(profile, bench.gains.period_s)
        least = enough(trajectory)
        found = {question: worth for question, worth in answers(trajectory).items() if worth >= least}
        return _Tested(profile, trajectory.duration_s, tuple(found), min(found.values(), default=0.0))

    tested: list[_Tested] = []
    for profiles in candidates(reach(runs, bench)):
        tested += in_parallel([partial(test, profile) for profile in profiles])
        if any(len(one.answered) == questions for one in tested):
            break
    best = max(tested, key=rank, default=None)
    return best if best and best.answered else None


def _group(explanation: Explanation, final: Fit, index: int) -> list[_Alternative]:
    """The final fit, and fits with each of the rivals that tie with one of its terms."""
    term, rebased = final.terms[index], final.hypothesis.rebased
    group = [_alternative(term.effect, final)]
    for rival in rivals_of(explanation, term):
        if rival.tied:
            other = rival.fit.terms[-1]
            replaced = rebased.replaced(index, other)
            if compatible(replaced.terms):  # else it was found later, as a cause of its own
                group.append(_alternative(other.effect, final.estimator.fit(replaced, evaluations=12)))
    return group


def _alternative(effect: str, found: Fit) -> _Alternative:
    """Prediction of a fit for another motion."""
    hypothesis = found.hypothesis
    once = [index for index, term in enumerate(hypothesis.terms) if BY_ID[term.effect].transient]
    gone = [column for index in once for column in range(hypothesis.x.size)[hypothesis.columns(index)]]
    known = _triangle(np.delete(found.jacobian, gone, axis=1))
    return _Alternative(effect, hypothesis.without(*once), known, found.estimator)


def _triangle(jacobian: FloatArray) -> FloatArray:
    """R of a QR decomposition."""
    return np.asarray(np.linalg.qr(jacobian, mode="r"), dtype=np.float64)


def _imagined(truth: _Alternative, trajectory: Trajectory, like: Measured) -> Measured:
    """Recording of a trajectory if the explanation were true: the noise level of a recording, none of it drawn."""
    position, velocity = np.array(trajectory.position_m), np.array(trajectory.velocity_m_s)
    start = Start(float(position[0]))
    answer = truth.hypothesis.twin().simulate(position, velocity, start)
    return replace(
        like,
        name="imagined",
        position_command_m=position,
        velocity_command_m_s=velocity,
        start=start,
        left_out=0,
        motor=answer.motor_position,
        table_m=answer.table_position_m if like.table_m.size else like.table_m,
        torque_command=answer.torque_command,
        torque=answer.torque_command if like.torque_is_command else answer.torque,
    )


def _own(truth: _Alternative, run: Measured) -> float:
    """Energy of the residuals of the truth on its own run: rounding, and the settling of the observer."""
    return truth.on(run).cost


def _left(other: _Alternative, run: Measured) -> float:
    """Energy of the residuals of an explanation on a run, its parameters refitted to first order."""
    there = other.on(run)
    slope = np.concatenate([other.known, there.estimator.jacobian(there.hypothesis)])
    target = np.concatenate([np.zeros(len(other.known)), there.residuals.vector])
    change, *_ = np.linalg.lstsq(slope, -target, rcond=None)
    left = target + slope @ change
    return float(left @ left)


def _pairs(questions: Collection[Question]) -> str:
    return ", and ".join(" from ".join(map(title, question)) for question in sorted(questions))
