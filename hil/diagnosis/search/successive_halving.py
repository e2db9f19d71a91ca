"""Successive halving (Jamieson and Talwalkar 2016): fit every candidate a little, keep the better ones, fit those on.

Losing candidates are not converged; only their ranking is used.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple, TypeVar

import numpy as np

from hil.arrays import FloatArray, SingleArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.initial_values import likenesses, other_variants
from hil.diagnosis.search.score_test import Candidate, offered
from hil.identification.coordinates import LAST_EDGE_STEP_S, TRUST
from hil.identification.estimator import Estimator, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import by_energy, refuted
from hil.identification.levenberg_marquardt import damped_step, normal_equations, robust_loss
from hil.identification.nominal_fit import SOFT
from hil.identification.parallel import POOL, in_parallel
from hil.identification.residual_scales import TORQUE_ACCURACY, factor_of_masses, inertia
from hil.identification.terms import compatible
from hil.identification.window_fit import fit_windows
from hil.twin.library import BY_ID

_Item = TypeVar("_Item")

# Torque accuracy of the motor channel in a search: its higher weight makes the cost of stick-slip smoother.
SEARCH_ACCURACY = 0.2
# Halving: 9 candidates get a first fit, 5 a second, 3 are converged; more of them only extend the search.
_STARTED, _CONTINUED, _FINISHED = 9, 5, 3
_FIRST, SECOND = 6, 4  # evaluations of the first fit (with the derivatives of the base) and of the second
LONG = 25  # evaluations of a last fit
# A second fit is converged if its cost is below _BEATEN times that of the converged leader or _LEVEL times that of the
# leader's second fit, and its gain above the share _BEHIND of the leader's: unconverged fits may be far from their end.
_BEATEN, _LEVEL, _BEHIND = 5.0, 1.5, 0.5
_SOLVED = 1e-9  # damping of a step that solves the normal equations, over their diagonal: only against singular ones
_EDGE_SHIFTS_S = np.arange(-15, 16) * 0.005  # tried shifts of an edge: its valley is narrower than a step of the fit


def race(base: Fit, candidates: Sequence[Candidate]) -> list[Fit]:
    """Fit the base with each of the first candidates, best first.

    The best is converged in all its variants, others only if their cost is near it.
    """
    hopeful = [one for one in candidates[:_STARTED] if one.score >= CRITERIA.worth * candidates[0].score]
    return _Race(base, hopeful).run()


def given_points(base: Fit) -> list[FloatArray]:
    """Points x of a base with nominal parameters of the bench: all of them, and only springs and shares of the masses.

    Fitted parameters may compensate for missing physics. A mechanism between motor and table changes the fitted springs
    and shares of the masses; friction and total mass remain right.
    """
    hypothesis, given = base.hypothesis, base.hypothesis.given.x
    bench, axis = hypothesis.bench, hypothesis.bench.axis
    if not axis.SPRINGS:
        return [given]

    factor = max(factor_of_masses(bench, inertia(base.bench)), 1.0 / TRUST)
    hidden = hypothesis.x.copy()
    for index, coordinate in enumerate(hypothesis.coordinates[: hypothesis.nominal_count]):
        if coordinate.name in axis.MASSES:
            hidden[index] = coordinate.x(factor * getattr(axis, coordinate.name))
        elif coordinate.name in axis.SPRINGS:
            hidden[index] = given[index]
    return [given, hidden]


class _FirstFit(NamedTuple):
    """A first fit without its Jacobian, its derivatives `own` (m, q) by the last term, and those of the base, shared.

    A forward difference has fewer digits than single precision, and these derivatives of a long recording take most
    of the memory of a diagnosis.
    """

    fit: Fit
    own: SingleArray
    held: SingleArray


@dataclass(frozen=True, eq=False)
class _Race:
    """One race: a base, its candidates, and the data shared by their fits."""

    base: Fit
    candidates: list[Candidate]

    @cached_property
    def search(self) -> Estimator:
        """Estimator of the first fits."""
        return replace(self.base.estimator, torque_accuracy=SEARCH_ACCURACY, fast=True)

    @cached_property
    def given(self) -> list[FloatArray]:
        """Points with the parameters of the bench."""
        return given_points(self.base)

    @cached_property
    def derivatives(self) -> dict[tuple[float, ...], SingleArray]:
        """Jacobian of the base by the point at which it was taken."""
        points = (self.base.hypothesis.x, *self.given)
        return {tuple(x): self.search.jacobian(self.base.hypothesis.moved(x)).astype(np.float32) for x in points}

    def run(self) -> list[Fit]:
        """Return the best fit of each mechanism, best first."""
        self.derivatives  # noqa: B018  computed before the threads start
        started = in_parallel([partial(self._first_fit, one) for one in self.candidates])
        # the best so far, and the first of the score test, which may converge slowly
        better = sorted(started, key=lambda one: one.fit.cost)[:_CONTINUED]
        second = in_parallel([partial(_second_fit, fit) for fit in _unique([*started[:2], *better])])
        del started, better  # derivatives of long recordings take much memory
        ranked = sorted(second, key=lambda fit: fit.cost)
        leader = finish(ranked[0])
        others = [fit for fit in _unique([*second[:2], *ranked[:_FINISHED]]) if fit is not ranked[0]]
        results = [leader, *self._followers(leader, ranked[0], others)]
        del second, ranked, others
        results = in_parallel([partial(self._from_start, fit) for fit in results])
        best = min(results, key=lambda fit: fit.cost)
        if not self.search.expired:
            results += [*variants(best), *equivalents(self.base, best)]
        fits: dict[str, Fit] = {}
        for fit in results:
            effect = fit.terms[-1].effect
            if compatible(fit.terms) and (effect not in fits or _rather(fit, fits[effect])):
                fits[effect] = fit
        return sorted(fits.values(), key=lambda fit: fit.cost)

    def _first_fit(self, candidate: Candidate) -> _FirstFit:
        """Fit a candidate briefly with the derivatives of the base, at the base or at the bench's parameters.

        A start may cost least only because its effect is small. Therefore the start that costs least after a step of
        the base's parameters is fitted too, and of the first candidates the variant preferred by the score test.
        """
        here = self.base.hypothesis.x
        begun = self._least(candidate, here, _soft, self._cost_beside_base)
        if candidate in self.candidates[:_CONTINUED]:
            begun.append(self._given_start(candidate))
            if begun[0].terms[-1].variant != candidate.term.variant:
                same = tuple(term for term in candidate.others if term.variant == candidate.term.variant)
                begun.append(self._best_start(replace(candidate, others=same), here))
        fits = []
        for start in begun:
            held = self.derivatives[tuple(start.hypothesis.x[: here.size])]
            fit = self.search.fit(start.hypothesis, soft=SOFT, evaluations=_FIRST, held=held)
            own = fit.jacobian[:, here.size :].astype(np.float32)
            fits.append(_FirstFit(replace(fit, jacobian=fit.jacobian[:, :0].copy()), own, held))
        return min(fits, key=lambda one: _soft(one.fit))

    def _best_start(self, candidate: Candidate, x: FloatArray) -> Fit:
        """Return the start of a candidate with the least cost at x."""
        return self._least(candidate, x, _soft)[0]

    def _least(self, candidate: Candidate, x: FloatArray, *costs: Callable[[Fit], float]) -> list[Fit]:
        """Return the starts of a candidate at x with the least of each cost, each start once."""
        base = self.base.hypothesis.moved(x)
        begun = [self.search.evaluate(base.with_term(term)) for term in (candidate.term, *candidate.others)]
        return _unique([min(begun, key=cost) for cost in costs])

    def _cost_beside_base(self, start: Fit) -> float:
        """Cost of a start after one linear step of the parameters of the base, within their bounds."""
        x, vector = self.base.hypothesis.x, start.residuals.vector
        low, high = (bound[: x.size] - x for bound in start.hypothesis.bounds)
        slopes = self.derivatives[tuple(x)].astype(np.float64)
        normal, descent = normal_equations(slopes, vector, robust_loss(vector, SOFT)[1])
        step = damped_step(normal, descent, _SOLVED, np.sqrt(np.diag(normal)), low, high)
        return robust_loss(vector + slopes @ step, SOFT)[0]

    def _given_start(self, candidate: Candidate) -> Fit:
        return min((self._best_start(candidate, x) for x in self.given), key=_soft)

    def _followers(self, leader: Fit, before: Fit, others: Sequence[Fit]) -> list[Fit]:
        """Evaluate the second fits, and converge those with a cost near that of the leader.

        `before` is the leader's second fit. If the leader is above the noise floor, its mechanism is also fitted from
        the parameters of the bench.
        """
        level, *reached = [fit.with_accuracy(TORQUE_ACCURACY) for fit in (before, *others)]
        beaten = max(_BEATEN * leader.cost, _LEVEL * level.cost)
        again = [] if leader.at_floor else [partial(self._from_bench_file, before)]
        near = [
            partial(finish, other)
            for other, fit in zip(others, reached, strict=True)
            if fit.cost < beaten and self._gain(fit) > _BEHIND * self._gain(leader)
        ]
        return [*reached, *in_parallel([*again, *near])]

    def _from_bench_file(self, fit: Fit) -> Fit:
        """Fit the same mechanism from the parameters of the bench with its own derivatives."""
        again = self._given_start(self._candidate(fit)).refit(SECOND, soft=SOFT)
        return finish(again) if self._gain(again) > 0.0 else again

    def _candidate(self, fit: Fit) -> Candidate:
        return next(one for one in self.candidates if one.term.effect == fit.terms[-1].effect)

    def _from_start(self, fit: Fit) -> Fit:
        """The fit, or that from a start of its mechanism beside the base's values which leaves less already."""
        start = self._best_start(self._candidate(fit), self.base.hypothesis.x)
        start = self.base.estimator.evaluate(start.hypothesis)
        return fit if fit.cost <= start.cost else start.refit(LONG)

    def _gain(self, fit: Fit) -> float:
        return self.base.cost - fit.cost


def _second_fit(first: _FirstFit) -> Fit:
    fit, slopes = first.fit, np.hstack([first.held, first.own])
    second = fit.estimator.fit(fit.hypothesis, evaluations=SECOND, soft=SOFT, slopes=slopes)
    if second.terms[-1].windows:  # a new Jacobian costs a simulation for each edge
        return second
    return replace(second, jacobian=second.jacobian[:, :0].copy())  # few fits are continued, and memory is dear


def variants(fit: Fit) -> list[Fit]:
    """Fit the other variants of the last term from its values."""
    rebased, others = fit.hypothesis.rebased, other_variants(fit.terms[-1], fit.bench)
    return in_parallel([partial(_fit_fast_first, fit.estimator, rebased.replaced(-1, term)) for term in others])


def equivalents(base: Fit, fit: Fit) -> list[Fit]:
    """Fit the mechanisms that may have the same effect as the last term of a fit on this motion."""
    terms, rebased = fit.terms, fit.hypothesis.rebased
    jobs = []
    for alike in likenesses(terms, fit.bench):
        if offered(alike[0], base.hypothesis, terms[:-1]):
            begun = in_parallel([partial(fit.estimator.evaluate, rebased.replaced(-1, term)) for term in alike])
            nearest = min(begun, key=lambda other: other.cost)
            jobs.append(partial(_fit_fast_first, fit.estimator, nearest.hypothesis))
    return in_parallel(jobs)


def _fit_fast_first(last: Estimator, hypothesis: Hypothesis) -> Fit:
    """Converge with the steps of a search, then with those of the twin."""
    fast = replace(last, fast=True).fit(hypothesis)
    return last.fit(fast.hypothesis, evaluations=SECOND, slopes=fast.jacobian)


def finish(fit: Fit) -> Fit:
    """Converge a fit, at last with the final weights."""
    if any(coordinate.edge for coordinate in fit.hypothesis.coordinates):
        fit = fit_windows(_edges_moved(fit.refit(LONG, slopes=fit.jacobian)))
    last = replace(fit.estimator, edge_step_s=LAST_EDGE_STEP_S)
    fit = last.fit(fit.hypothesis, evaluations=LONG, slopes=fit.jacobian)
    return replace(last, torque_accuracy=TORQUE_ACCURACY, fast=False).fit(fit.hypothesis, evaluations=SECOND)


def _edges_moved(fit: Fit) -> Fit:
    """Move each edge of a window to the least cost within 75 ms, then fit."""
    hypothesis = fit.hypothesis
    for index, coordinate in enumerate(hypothesis.coordinates):
        if coordinate.edge:
            edges = np.tile(hypothesis.x, (_EDGE_SHIFTS_S.size, 1))
            edges[:, index] = [coordinate.x(coordinate.value(edges[0, index]) + shift) for shift in _EDGE_SHIFTS_S]
            shifted = [hypothesis.moved(x) for x in np.clip(edges, *hypothesis.bounds)]
            hypothesis = min(POOL.map(fit.estimator.evaluate, shifted), key=lambda other: other.cost).hypothesis
    return fit.estimator.fit(hypothesis, evaluations=LONG)


def _rather(fit: Fit, known: Fit) -> bool:
    """True if a fit is to stand for its mechanism rather than another one of the same mechanism."""
    mine, other = fit.terms[-1], known.terms[-1]
    rank, of_known = (BY_ID[one.effect].search.rank(one.variant) for one in (mine, other))
    if rank == of_known:
        return fit.cost < known.cost
    return not _behind(fit, known) if rank < of_known else _behind(known, fit)


def _behind(worse: Fit, better: Fit) -> bool:
    """True if the residuals refute a form of a mechanism against another form of it."""
    return refuted(by_energy(better, worse), (worse.cost - better.cost) / better.rows)


def _soft(fit: Fit) -> float:
    return robust_loss(fit.residuals.vector, SOFT)[0]


def _unique(items: Sequence[_Item]) -> list[_Item]:
    """Each item once, in order."""
    return list({id(item): item for item in items}.values())
