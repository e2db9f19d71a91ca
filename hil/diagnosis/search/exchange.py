"""Compare each name with its rivals again, beside all the other terms of the explanation.

Where a term was added, what was still missing may have favoured a rival, or the term. The steps of a stepwise selection
that only add and remove do not mend this; one that exchanges does (Miller 2002, "Subset Selection in Regression").
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from hil.diagnosis.ledger import Considered
from hil.diagnosis.search.events import beside_loads
from hil.diagnosis.search.next_term import SearchRound
from hil.diagnosis.search.rivals import ENDED, NEAR, RivalFit, chosen
from hil.identification.estimator import Fit
from hil.identification.terms import Key, Term, compatible, effects, free_slot


@dataclass(frozen=True, eq=False)
class Exchange:
    """An explanation with its rivals as they compare beside all its terms, and the ledgers of those compared."""

    fit: Fit
    rivals: dict[Key, list[RivalFit]]
    considered: tuple[Considered, ...]


def exchanged(fit: Fit, rivals: Mapping[Key, list[RivalFit]], nominal: Fit, given: Fit) -> Exchange:
    """Ask of each term whether it or a rival near it is to be named beside the others, up to one that gives way.

    The term added last was compared beside all others already.
    """
    found, considered = dict(rivals), list[Considered]()
    for index, term in enumerate(fit.terms[:-1]):
        others = [one for one in fit.terms if one is not term]
        near = [one for one in rivals.get(term.key, ()) if one.reduced < NEAR * one.named]
        starts = _beside(others, near, fit)
        if not starts or fit.estimator.expired:
            continue
        without = fit.hypothesis.without(index)
        base = fit.estimator.fit(without, evaluations=ENDED)
        search = SearchRound(base, beside_loads(nominal, base), given)
        named, *rest = (
            search.addition(fit.estimator.fit(without.with_term(one), evaluations=ENDED)) for one in (term, *starts)
        )
        choice = chosen(named, [named, *rest], search)
        best, considered = choice.named.fit, [*considered, *choice.considered]
        if effects(best.terms) != effects(fit.terms):
            return Exchange(best, {**found, best.terms[-1].key: choice.rivals}, tuple(considered))
        found[term.key] = [*choice.rivals, *(one for one in rivals[term.key] if one not in near)]
    return Exchange(fit, found, tuple(considered))


def _beside(others: Sequence[Term], rivals: Sequence[RivalFit], fit: Fit) -> list[Term]:
    """The terms of rivals that can stand beside others."""
    known = [entry.active() for entry in fit.hypothesis.kept]
    terms = [replace(one.terms[-1], slot=free_slot(one.terms[-1].effect, others)) for one in rivals]
    return [one for one in terms if compatible((*others, one, *known))]
