"""Restart of the search at the bench-file parameters: nominal refitting can absorb a missing effect.

A score test projects out everything that unbounded parameters could explain. Bounded parameters explain less: of
a spring on a table, 47 times the noise, the projection removed 94 % and the refit a tenth. If no term is found and more
than noise is left, the library is screened again at the parameters of the bench file, without the projection.

A nut without preload is softer within its gap. A refit of other springs in series and of their damping absorbs most of
that, and the local score test finds no descent direction. So such a mechanism is fitted from the springs of the bench
file (`SearchHints.restarts`). With a single spring it is equal to a softer spring.

Some mechanisms are seldom alone: a table with play stays where it is by its own friction, and without it coasts through
the gap. Each of the two alone fits worse than a wrong one, so they are fitted together (`SearchHints.beside`).

A fit that leaves more than noise while a nominal parameter is at its bound may be a local minimum: there the mechanisms
found are fitted once more, from the parameters of the bench file and typical values, in each form of their laws.
"""

from dataclasses import replace
from functools import partial

from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.search.initial_values import stretches
from hil.diagnosis.search.score_test import screen_library
from hil.diagnosis.search.successive_halving import LONG, SEARCH_ACCURACY, given_points, race
from hil.identification.coordinates import LAST_EDGE_STEP_S
from hil.identification.estimator import Fit
from hil.identification.nominal_fit import SOFT
from hil.identification.parallel import in_parallel
from hil.identification.residual_scales import TORQUE_ACCURACY
from hil.identification.terms import Term, compatible
from hil.twin.library import BY_ID, LIBRARY

_FIRST, _SECOND = 8, 20  # evaluations: a fit starts farther from its minimum than those of a race
_NARROWEST_M = 1e-6  # least first gap, if the deflection between motor and table is negligible


def from_bench_file(base: Fit) -> list[Fit]:
    """Fit the first candidates at the nominal parameters of the bench file, best first."""
    # not fitted, so without a Jacobian: the score test has no projection
    given = base.estimator.evaluate(base.hypothesis.moved(given_points(base)[-1]))
    promising = screen_library(given)
    return race(given, promising) if promising else []


def companion(base: Fit, fit: Fit) -> Term | None:
    """The mechanism to fit together with the last term of a fit; None without one that the base can take."""
    effect = BY_ID[fit.terms[-1].effect].search.beside
    if not effect:
        return None
    term = Term(effect, 0, BY_ID[effect].typical_values(axis_facts(base.bench, base.data.runs)))
    known = [entry.active() for entry in base.hypothesis.kept]
    return term if compatible((*fit.terms, term, *known)) else None


def together(base: Fit, fit: Fit, other: Term) -> list[Fit]:
    """Fit mechanisms like the last term of a fit beside another term, from the parameters of the bench; best first."""
    given = base.hypothesis.moved(given_points(base)[0]).with_term(other)
    beside = base.estimator.fit(given, evaluations=_SECOND, fixed=range(given.nominal_count))
    alike = [one for one in screen_library(beside) if BY_ID[one.term.effect].search.beside == other.effect]
    likely = [one for one in alike if one.score > 0.0]
    return race(beside, likely) if likely else []


def again(fit: Fit, evaluations: int) -> Fit:
    """The fit, or a better one of the same mechanisms from the bench file, if a nominal parameter is at its bound."""
    stuck = set(fit.at_bound).intersection(fit.hypothesis.nominal)
    if not fit.terms or not stuck or fit.at_floor or fit.estimator.expired:
        return fit
    given, axis = fit.hypothesis.rebased.given, axis_facts(fit.data.bench, fit.data.runs)
    starts = [
        given.replaced(index, replace(term, variant=variant, values=BY_ID[term.effect].typical_values(axis)))
        for index, term in enumerate(fit.terms)
        if not term.windows
        for variant in range(len(BY_ID[term.effect].variants))
    ]
    fits = in_parallel([partial(fit.estimator.fit, start, evaluations=evaluations) for start in starts])
    return min((fit, *fits), key=lambda one: one.cost)


def may_hide(base: Fit) -> bool:
    """True if the axis has several springs and a linear encoder, and springs may hide a mechanism beside its terms."""
    several = len(base.bench.axis.physics().chain.names) > 2
    return several and bool(base.data.runs[0].table_m.size) and bool(_hidden(base))


def _hidden(base: Fit) -> list[Term]:
    """Starts of all mechanisms that springs may hide and that are compatible with the terms of the base."""
    widest_m = max(stretches(base.data.runs, base.bench.axis.ratio_m_rad)[1], _NARROWEST_M)
    starts = [Term(one.id, 0, tuple(values)) for one in LIBRARY for values in one.search.restarts(widest_m)]
    known = [entry.active() for entry in base.hypothesis.kept]
    return [start for start in starts if compatible((*base.terms, start, *known))]


def unbent(base: Fit) -> Fit:
    """Fit the base with a mechanism that springs may hide, from the springs of the bench file."""
    given = base.hypothesis.moved(given_points(base)[-1])
    search = replace(base.estimator, torque_accuracy=SEARCH_ACCURACY, fast=True)
    starts = [given.with_term(term) for term in _hidden(base)]
    held = search.jacobian(given)
    first = [partial(search.fit, start, soft=SOFT, evaluations=_FIRST, held=held) for start in starts]
    best = min(in_parallel(first), key=lambda fit: fit.cost)
    full = replace(search, fast=False)  # small gaps need the steps of the twin
    best = full.fit(best.hypothesis, soft=SOFT, evaluations=_SECOND)
    if best.cost > full.evaluate(base.hypothesis).cost:  # worse than without the term
        return best.with_accuracy(TORQUE_ACCURACY)
    last = replace(full, torque_accuracy=TORQUE_ACCURACY, edge_step_s=LAST_EDGE_STEP_S)
    return last.fit(best.hypothesis, evaluations=LONG)
