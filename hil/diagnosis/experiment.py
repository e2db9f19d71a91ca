"""Design the motion that separates mechanisms that the recorded one cannot: T-optimal (Atkinson and Fedorov 1975).

    evidence = min over a of  |J_o a|^2 + |r + J a|^2,  less the same of the truth

One hypothesis is assumed true: its closed loop over a candidate's set-points is a recording without noise. r are the
residuals of the other on it, block by block in units of noise, J their derivatives, and J_o those on the existing
recordings, which restrict the parameters. The evidence is the lower one of both assignments of the truth.
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
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.stages import Searched
from hil.diagnosis.verdict.findings import rivals_of
from hil.diagnosis.verdict.testability import not_testable
from hil.diagnosis.wording import title
from hil.identification.dataset import Dataset
from hil.identification.estimator import Estimator, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.parallel import in_parallel
from hil.identification.terms import compatible, same_torque
from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan
from hil.quantities import digits
from hil.twin.axis import Start
from hil.twin.library import BY_ID

NEXT_EXPERIMENT = "next_experiment.yaml"  # its profile, beside the result

Question = tuple[str, ...]  # two effects to be distinguished, or one to be shown
Answers = Mapping[Question, float]


@dataclass(frozen=True, eq=False)
class Experiment:
    """The motion to run next, the mechanisms that it distinguishes or shows, and a note on the expected result.

    `profile` is None if no motion within the reach of the recordings answers a question.
    """

    profile: Profile | None
    separates: tuple[str, ...]
    note: str


@dataclass(frozen=True, eq=False)
class _Alternative:
    """An searched of the recordings; `known` is R of their Jacobian J_o = Q R."""

    effect: str
    hypothesis: Hypothesis
    known: FloatArray
    estimator: Estimator

    def on(self, run: Measured) -> Fit:
        """The searched evaluated on another run."""
        data = self.estimator.data.over([run])
        return replace(self.estimator, data=data).evaluate(self.hypothesis)


def separating(searched: Searched, final: Fit, held_out: Dataset) -> Experiment | None:
    """Design the motion that separates the terms of `final` from their tied rivals; None if there are none.

    Of the motions that separate most pairs it is the one with the most evidence per second for the hardest pair.
    """
    train = final.data
    pairs = [pair for index in range(len(final.terms)) for pair in permutations(_group(searched, final, index), 2)]
    if not pairs:
        if not (same := list(dict.fromkeys(filter(None, map(same_torque, final.terms))))):
            return None
        return Experiment(None, (), f"No motion distinguishes {_pairs(same)}: both cause the same torque on each.")

    asked: set[Question] = {tuple(sorted((truth.effect, other.effect))) for truth, other in pairs}

    known, channels = final.rows, final.rows / train.rows

    def enough(trajectory: Trajectory) -> float:
        # with the existing recordings, the difference must refute the rival (see `RivalFit.tied`)
        return max(CRITERIA.tied, CRITERIA.alike * (known + channels * len(trajectory)))

    def answers(trajectory: Trajectory) -> Answers:
        found, least = dict.fromkeys(asked, np.inf), enough(trajectory)
        for truth, other in pairs:
            question = tuple(sorted((truth.effect, other.effect)))
            if found[question] >= least:  # else the other assignment of the truth is below already
                run = _imagined(truth, trajectory, train.runs[0])
                # on its own run the truth leaves rounding and the settling of the observer
                found[question] = min(found[question], _left(other, run) - truth.on(run).cost)
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
        return Experiment(None, (), f"No motion within the range of these recordings distinguishes {_pairs(asked)}.")
    return Experiment(
        best.profile,
        best.effects,
        f"{best.what} is expected to distinguish {_pairs(best.answered)}, with "
        f"evidence of {digits(best.worth)} or more, where {CRITERIA.tied:g} is very strong.",
    )


def showing(fit: Fit, hidden: Sequence[str], held_out: Dataset) -> Experiment | None:
    """Design the motion that shows most of the hidden mechanisms per second; None if none is hidden."""
    if not hidden:
        return None
    expected = _alternative("", fit)

    def answers(trajectory: Trajectory) -> Answers:
        there = expected.on(_imagined(expected, trajectory, fit.data.runs[0]))
        there = replace(there, jacobian=there.estimator.jacobian(there.hypothesis))
        still = not_testable(there, hidden, CRITERIA.visible)
        return {(effect,): float(effect not in still) for effect in hidden}

    best = _best(
        (*fit.data.runs, *held_out.runs),
        fit.hypothesis.bench,
        len(hidden),
        answers,
        lambda _: 1.0,
        lambda one: len(one.answered) / one.duration_s,
    )
    names = ", ".join(map(title, best.effects if best else hidden))
    if best is None:
        return Experiment(None, (), f"No motion within the range of these recordings shows {names}.")
    return Experiment(best.profile, best.effects, f"{best.what} would show {names} at a typical strength.")


@dataclass(frozen=True, eq=False)
class _Tested:
    """A candidate motion, its duration, the questions that it answers, and the least evidence for one of them."""

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
    """Return the candidate of the highest rank; long ones are tried only if no short one answers all questions."""

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


def _group(searched: Searched, final: Fit, index: int) -> list[_Alternative]:
    """Return the final fit, and a fit with each tied rival of one of its terms."""
    term, rebased = final.terms[index], final.hypothesis.rebased
    group = [_alternative(term.effect, final)]
    for rival in rivals_of(searched, term):
        if rival.tied:
            other = rival.terms[-1]
            replaced = rebased.replaced(index, other)
            if compatible(replaced.terms):  # else the rival is another term of the final fit
                group.append(_alternative(other.effect, final.estimator.fit(replaced, evaluations=12)))
    return group


def _alternative(effect: str, fit: Fit) -> _Alternative:
    """Prediction of a fit for another motion."""
    hypothesis = fit.hypothesis
    once = [index for index, term in enumerate(hypothesis.terms) if BY_ID[term.effect].transient]
    gone = [column for index in once for column in range(hypothesis.x.size)[hypothesis.columns(index)]]
    known = np.asarray(np.linalg.qr(np.delete(fit.jacobian, gone, axis=1), mode="r"), dtype=np.float64)
    return _Alternative(effect, hypothesis.without(*once), known, fit.estimator)


def _imagined(truth: _Alternative, trajectory: Trajectory, like: Measured) -> Measured:
    """Simulate the recording of a trajectory under an searched: without noise, with the noise level of `like`."""
    position, velocity = np.array(trajectory.position_m), np.array(trajectory.velocity_m_s)
    start = Start(float(position[0]))
    answer = truth.hypothesis.twin().simulate(position, velocity, start)
    return replace(
        like,
        name="imagined",
        position_command_m=position,
        velocity_command_m_s=velocity,
        start=start,
        motor=answer.motor_position,
        table_m=answer.table_position_m if like.table_m.size else like.table_m,
        torque_command=answer.torque_command,
        torque=answer.torque if like.observability.torque_and_command else answer.torque_command,
        feedforward=np.empty(0),
    )


def _left(other: _Alternative, run: Measured) -> float:
    """Energy of the residuals of an searched on a run, its parameters refitted to first order."""
    there = other.on(run)
    slope = np.concatenate([other.known, there.estimator.jacobian(there.hypothesis)])
    target = np.concatenate([np.zeros(len(other.known)), there.residuals.vector])
    change, *_ = np.linalg.lstsq(slope, -target, rcond=None)
    left = target + slope @ change
    return float(left @ left)


def _pairs(questions: Collection[Question]) -> str:
    return ", and ".join(" from ".join(map(title, question)) for question in sorted(questions))
