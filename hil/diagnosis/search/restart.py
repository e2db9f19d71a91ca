"""Restart of the search at the bench-file parameters: nominal refitting can absorb a missing effect.

A score test removes from the residual, and from the effect of a mechanism, everything that parameters could explain if
they had no bounds. That is more than they can: 94 % of the effect of a spring on a table, 47 times the noise, where the
refit explained a tenth. Where nothing more is found and most of the mismatch is left, the library is screened again
at the parameters of the bench file, with nothing removed.

A nut without preload is softer while it stays in its gap. Where other springs are in series with it, a refit changes
these and their damping until little is left, and the score test, which is local, finds no descent direction. So the
mechanism is fitted from the bench file's springs. With one spring alone it would be the same as a softer spring.
"""

from dataclasses import replace
from functools import partial

from hil.diagnosis.search.initial_values import claimable, stretches
from hil.diagnosis.search.score_test import screen_library
from hil.diagnosis.search.successive_halving import LONG, SEARCH_ACCURACY, owner_points, race
from hil.identification.dataset import TORQUE_ACCURACY
from hil.identification.estimator import Fit, in_parallel
from hil.identification.hypothesis import LAST_EDGE_STEP_S
from hil.identification.nominal_fit import SOFT
from hil.identification.terms import Term, compatible
from hil.twin.library import LIBRARY

_EFFECT, _STARTS = next((mechanism.id, mechanism.hidden_starts) for mechanism in LIBRARY if mechanism.hidden_starts)
_FIRST = 20  # evaluations of a first fit: it starts farther from its end than those of a race
_NARROWEST_M = 1e-6  # first gap where motor and table never separate


def from_owner(base: Fit) -> list[Fit]:
    """Fits of the base with each of the first candidates beside the parameters of the bench file, best first."""
    # not fitted, so without derivatives: the score test removes nothing
    owner = base.estimator.evaluate(base.hypothesis.moved(owner_points(base)[-1]))
    promising = [one for one in screen_library(owner) if claimable(one.term, owner.bench)]
    return race(owner, promising) if promising else []


def may_hide(base: Fit) -> bool:
    """Whether the axis has several springs, a linear encoder that shows them, and no lost preload yet."""
    known = [entry.active() for entry in base.hypothesis.kept]
    return (
        len(base.bench.axis.physics().chain.names) > 2
        and bool(base.data.runs[0].table_m.size)
        and compatible((*base.terms, Term(_EFFECT, 0, _STARTS[0]), *known))
    )


def unbent(base: Fit) -> Fit:
    """The base with a lost preload, fitted from the springs of the bench file."""
    widest_m = max(stretches(base.data.runs, base.bench.axis.ratio_m_rad)[1], _NARROWEST_M)
    owner = base.hypothesis.moved(owner_points(base)[-1])
    search = replace(base.estimator, torque_accuracy=SEARCH_ACCURACY)
    starts = [owner.with_term(Term(_EFFECT, 0, (share * widest_m, *rest))) for share, *rest in _STARTS]
    best = min(
        in_parallel([partial(search.fit, start, soft=SOFT, evaluations=_FIRST) for start in starts]),
        key=lambda found: found.cost,
    )
    last = replace(search, torque_accuracy=TORQUE_ACCURACY, edge_step_s=LAST_EDGE_STEP_S)
    return last.fit(best.hypothesis, evaluations=LONG)
