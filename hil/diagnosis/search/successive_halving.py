"""Successive halving (Jamieson and Talwalkar 2016): fit every candidate a little, keep the better ones, fit those on.

Losing candidates are not converged; only their ranking is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.search.initial_values import likenesses
from hil.diagnosis.search.score_test import Candidate, offered
from hil.identification.dataset import TORQUE_ACCURACY, inertia
from hil.identification.estimator import POOL, Estimator, Fit, in_parallel, soft_cost
from hil.identification.hypothesis import LAST_EDGE_STEP_S, TRUST
from hil.identification.nominal_fit import SOFT
from hil.identification.terms import compatible
from hil.twin.library import BY_ID

# Weight of the motor channel in a search: the full resolution of the encoder makes the valleys of stick-slip convex.
SEARCH_ACCURACY = 0.2
LONG = 25  # evaluations of a last fit
_STARTED = 8  # candidates that are fitted
_CONTINUED = 4  # of which are fitted on
_FINISHED = 3  # of which are fitted to the end
_FIRST = 6  # evaluations of a first fit with the derivatives of the base
_SECOND = 4  # and of the one after it
_BEATEN = 5.0  # times the cost of the leader: a second fit above is not converged,
_LEVEL = 1.5  # except where it is level with the leader's second fit;
_BEHIND = 0.5  # nor one whose gain is less than this share of the leader's
_HOPELESS = 0.02  # share of the first candidate's: below, a candidate is not fitted
_EDGE_SHIFTS_S = np.arange(-15, 16) * 0.005  # of an edge, where it may have been missed


def race(base: Fit, candidates: Sequence[Candidate]) -> list[Fit]:
    """Fits of the base with each of the first candidates, best first.

    All start; the best is converged, in all its variants. Others are converged, too, if they come near it.
    """
    return _Race(base, [one for one in candidates[:_STARTED] if one.share > _HOPELESS * candidates[0].share]).run()


def owner_points(base: Fit) -> list[FloatArray]:
    """The x of a base with the nominal parameters of the bench: all of them, and those hidden by a rigid-body fit.

    The fitted parameters of the base may compensate for missing physics. A mechanism between motor and table distorts
    the springs and the shares of the masses; friction and the total mass stay right.
    """
    hypothesis, owner = base.hypothesis, base.hypothesis.owner.x
    bench, axis = hypothesis.bench, hypothesis.bench.axis
    if not axis.SPRINGS:
        return [owner]

    def heavier(factor: float) -> Bench:
        return bench.model_copy(
            update={"axis": axis.model_copy(update={name: factor * getattr(axis, name) for name in axis.MASSES})}
        )

    light, heavy, wanted = inertia(bench), inertia(heavier(2.0)), inertia(base.bench)
    factor = max(1.0 + (wanted - light) / (heavy - light), 1.0 / TRUST)
    hidden = hypothesis.x.copy()
    for index, coordinate in enumerate(hypothesis.coordinates[: hypothesis.nominal_count]):
        if coordinate.name in axis.MASSES:
            hidden[index] = coordinate.x(factor * getattr(axis, coordinate.name))
        elif coordinate.name in axis.SPRINGS:
            hidden[index] = owner[index]
    return [owner, hidden]


@dataclass(frozen=True, eq=False)
class _Race:
    """One race: a base, the candidates beside it, and what all their fits share."""

    base: Fit
    candidates: list[Candidate]

    @cached_property
    def search(self) -> Estimator:
        """The estimator of the first fits."""
        return replace(self.base.estimator, torque_accuracy=SEARCH_ACCURACY)

    @cached_property
    def owner(self) -> list[FloatArray]:
        """Points with the parameters of the bench."""
        return owner_points(self.base)

    @cached_property
    def derivatives(self) -> dict[tuple[float, ...], FloatArray]:
        """Jacobian of the base by the point at which it was taken."""
        points = (self.base.hypothesis.x, *self.owner)
        return {tuple(x): self.search.jacobian(self.base.hypothesis.moved(x)) for x in points}

    def run(self) -> list[Fit]:
        """The best fit of each mechanism, best first."""
        self.derivatives  # noqa: B018  before threads ask for them
        started = in_parallel([partial(self._first_fit, one) for one in self.candidates])
        # the best so far, and the first of the score test, which may only converge slowly
        better = sorted(started, key=lambda fit: fit.cost)[:_CONTINUED]
        second = in_parallel([partial(self._second_fit, fit) for fit in _unique([*started[:2], *better])])
        ranked = sorted(second, key=lambda fit: fit.cost)
        leader = _finish(ranked[0])
        others = [fit for fit in _unique([*second[:2], *ranked[:_FINISHED]]) if fit is not ranked[0]]
        results = [leader, *self._followers(leader, ranked[0], others)]
        best = min(results, key=lambda fit: fit.cost)
        results += [*self._variants(best), *self._equivalents(best)]
        found: dict[str, Fit] = {}
        for fit in results:
            effect = fit.terms[-1].effect
            if compatible(fit.terms) and (effect not in found or fit.cost < found[effect].cost):
                found[effect] = fit
        return sorted(found.values(), key=lambda fit: fit.cost)

    def _first_fit(self, candidate: Candidate) -> Fit:
        """A short fit with the derivatives of the base, from the base or from the parameters of the bench.

        Of the first candidates the variant preferred by the score test starts too: another may have so little effect
        that its cost is lower at the start.
        """
        here = self.base.hypothesis.x
        begun = [self._best_start(candidate, here)]
        if candidate in self.candidates[:_CONTINUED]:
            begun.append(self._owner_start(candidate))
            if begun[0].terms[-1].variant != candidate.term.variant:
                same = tuple(term for term in candidate.others if term.variant == candidate.term.variant)
                begun.append(self._best_start(replace(candidate, others=same), here))
        fits = [
            self.search.fit(
                start.hypothesis,
                soft=SOFT,
                evaluations=_FIRST,
                held=self.derivatives[tuple(start.hypothesis.x[: here.size])],
            )
            for start in begun
        ]
        return min(fits, key=_soft)

    def _best_start(self, candidate: Candidate, x: FloatArray) -> Fit:
        """The start of a candidate that leaves the least cost beside the base at x."""
        base = self.base.hypothesis.moved(x)
        return min(
            (self.search.evaluate(base.with_term(term)) for term in (candidate.term, *candidate.others)), key=_soft
        )

    def _owner_start(self, candidate: Candidate) -> Fit:
        """The best start of a candidate at the parameters of the bench."""
        return min((self._best_start(candidate, x) for x in self.owner), key=_soft)

    def _second_fit(self, fit: Fit) -> Fit:
        return fit.refit(_SECOND, soft=SOFT, slopes=fit.jacobian)

    def _followers(self, leader: Fit, before: Fit, others: Sequence[Fit]) -> list[Fit]:
        """Evaluations of the second fits, and those of them that come near the leader fitted to the end.

        `before` is the leader's second fit. Where the leader is above the noise floor, its mechanism is fitted again
        from the parameters of the bench.
        """
        level, *reached = [fit.with_accuracy(TORQUE_ACCURACY) for fit in (before, *others)]
        beaten = max(_BEATEN * leader.cost, _LEVEL * level.cost)
        again = [] if leader.at_floor else [partial(self._from_owner, before)]
        near = [
            partial(_finish, other)
            for other, fit in zip(others, reached, strict=True)
            if fit.cost < beaten and self._gain(fit) > _BEHIND * self._gain(leader)
        ]
        return [*reached, *in_parallel([*again, *near])]

    def _from_owner(self, fit: Fit) -> Fit:
        """A fit of the same mechanism from the parameters of the bench, with derivatives of its own."""
        candidate = next(one for one in self.candidates if one.term.effect == fit.terms[-1].effect)
        again = self._owner_start(candidate).refit(_SECOND, soft=SOFT)
        return _finish(again) if self._gain(again) > 0.0 else again

    def _variants(self, fit: Fit) -> list[Fit]:
        """The other variants of the last term, from its values."""
        last, rebased = fit.terms[-1], fit.hypothesis.rebased
        others = [replace(last, variant=v) for v in range(len(BY_ID[last.effect].variants)) if v != last.variant]
        return in_parallel([partial(fit.estimator.fit, rebased.replaced(-1, term)) for term in others])

    def _equivalents(self, fit: Fit) -> list[Fit]:
        """Mechanisms that may have the same effect as the last term on this motion, from its values."""
        terms, rebased = fit.terms, fit.hypothesis.rebased
        jobs = []
        for alike in likenesses(terms, fit.bench):
            if offered(alike[0], self.base.hypothesis, terms[:-1]):
                begun = in_parallel([partial(fit.estimator.evaluate, rebased.replaced(-1, term)) for term in alike])
                jobs.append(partial(fit.estimator.fit, min(begun, key=lambda other: other.cost).hypothesis))
        return in_parallel(jobs)

    def _gain(self, fit: Fit) -> float:
        return self.base.cost - fit.cost


def _finish(fit: Fit) -> Fit:
    """Fit to the end, at last with the accuracy of the final weights."""
    if any(coordinate.edge for coordinate in fit.hypothesis.coordinates):
        fit = _edges_moved(fit.refit(LONG, slopes=fit.jacobian))
    last = replace(fit.estimator, edge_step_s=LAST_EDGE_STEP_S)
    fit = last.fit(fit.hypothesis, evaluations=LONG, slopes=fit.jacobian)
    return replace(last, torque_accuracy=TORQUE_ACCURACY).fit(fit.hypothesis, evaluations=_SECOND)


def _edges_moved(fit: Fit) -> Fit:
    """A fit with each edge of a window where the cost is least: its valley is narrower than a step."""
    hypothesis = fit.hypothesis
    for index, coordinate in enumerate(hypothesis.coordinates):
        if coordinate.edge:
            edges = np.tile(hypothesis.x, (_EDGE_SHIFTS_S.size, 1))
            edges[:, index] = [coordinate.x(coordinate.value(edges[0, index]) + shift) for shift in _EDGE_SHIFTS_S]
            shifted = [hypothesis.moved(x) for x in np.clip(edges, *hypothesis.bounds)]
            hypothesis = min(POOL.map(fit.estimator.evaluate, shifted), key=lambda other: other.cost).hypothesis
    return fit.estimator.fit(hypothesis, evaluations=LONG)


def _soft(fit: Fit) -> float:
    return soft_cost(fit.residuals.vector, SOFT)


def _unique(fits: Sequence[Fit]) -> list[Fit]:
    """Each fit once, in order."""
    return list({id(fit): fit for fit in fits}.values())
