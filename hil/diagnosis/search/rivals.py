"""Which of several explanations of one residual is named, and how the others compare with it.

The named one is the first that can be the cause. An explanation whose evidence is not worse is tied with it, or there
is an objection to it: a reason beside its evidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.search.next_term import objection, valid, worthwhile
from hil.identification.coordinates import LAST_EDGE_STEP_S
from hil.identification.estimator import Fit, FitStatus
from hil.identification.inference import TIED, Filter, against, between, refuted, whitening
from hil.identification.terms import Term, is_frequent
from hil.twin.library import BY_ID

_NEAR = 1.1  # cost over that of the chosen explanation, up to which the fit of a rival is ended before it is compared
ENDED = 40  # evaluations: a fit that starts near its minimum converges within them


@dataclass(frozen=True, eq=False)
class RivalFit:
    """Another explanation of the same residual and the evidence against it (BIC difference; < 0 favours it).

    `reduced` is its mean squared weighted residual, `more` its energy per row in units of noise^2 less that of the
    chosen explanation, whose mean square is `named`. `objection` is why it cannot be the cause, `behind` why the other
    is named though the evidence favours this one. The fit itself is not kept: its residuals and derivatives grow with
    the recordings.
    """

    terms: tuple[Term, ...]
    reduced: float
    evidence: float
    more: float = np.inf
    named: float = np.nan
    objection: str = ""
    behind: str = ""

    @classmethod
    def of(cls, fit: Fit, evidence: float, more: float = np.inf) -> "RivalFit":
        """The explanation by a fit."""
        return cls(fit.terms, fit.reduced, evidence, more)

    @property
    def tied(self) -> bool:
        """True if neither its evidence nor an objection refutes it."""
        return not self.objection and not refuted(self.evidence, self.more)


def chosen(best: Fit, found: Sequence[Fit], base: Fit, reference: Fit, owner: Fit) -> tuple[Fit, list[RivalFit]]:
    """Return the explanation to name, converged, and its rivals, the strongest first.

    `best` is the first of `found` so far: those near it are ended too, and may then come before it. `base` is the fit
    without the last term, `reference` and `owner` as in `next_term`.
    """
    begun = [one for one in found if one is not best]
    if not best.jacobian.size:  # only evaluated so far, since the fitted ones were rejected
        best = replace(best.estimator, edge_step_s=LAST_EDGE_STEP_S).fit(best.hypothesis)
    best = (valid([ended(best)]) or [best])[0]
    others = [ended(one) if one.cost < _NEAR * best.cost else one for one in begun]
    order = sorted([best, *valid(others)], key=lambda fit: fit.cost)
    best = worthwhile([one for one in order if one.jacobian.size], base, reference, owner) or best
    standing = [one for one in order if one is not best and not objection(one, best, base, owner)]
    named = _on_fewest_parts(_simplest(best, standing), [best, *standing])
    filters = whitening(named)
    rivals = [_compared(one, named, base, owner, filters) for one in order if one is not named]
    return named, sorted(rivals, key=lambda rival: rival.evidence)


def ended(found: Fit) -> Fit:
    """The fit, continued if it ran out of steps: only then its cost refutes it."""
    return found.refit(ENDED, slopes=found.jacobian) if found.status is FitStatus.OUT_OF_STEPS else found


def _simplest(best: Fit, others: Sequence[Fit]) -> Fit:
    """Return the explanation with the fewest parameters of those that the evidence does not separate.

    Of two mechanisms with the same torque on every motion the more frequent cause is preferred.
    """
    tied = [best, *(other for other in others if other.jacobian.size and against(best, other) < TIED)]
    return min(tied, key=lambda found: (found.hypothesis.free, not is_frequent(found.terms[-1])))


def _on_fewest_parts(best: Fit, others: Sequence[Fit]) -> Fit:
    """Return the explanation on the fewest parts of the axis of those that are not refuted.

    What a part does that is found already needs no second cause elsewhere.
    """
    filters = whitening(best)
    tied = [
        one
        for one in others
        if one is not best
        and one.jacobian.size
        and one.hypothesis.free <= best.hypothesis.free
        and not refuted(between(best, one, filters), _more(one, best))
    ]
    return min([best, *tied], key=_parts)


def _parts(found: Fit) -> int:
    return len({BY_ID[term.effect].element_of(term.variant) for term in found.terms})


def _more(one: Fit, named: Fit) -> float:
    return (one.cost - named.cost) / named.rows


def _compared(one: Fit, named: Fit, base: Fit, owner: Fit, filters: Sequence[Filter]) -> RivalFit:
    """Compare an explanation with the named one; what is refuted by its evidence needs no other reason."""
    evidence, more = between(named, one, filters), _more(one, named)
    reason = "" if refuted(evidence, more) else objection(one, named, base, owner)
    behind = _behind(one, named) if evidence < 0.0 else ""
    return RivalFit(one.terms, one.reduced, evidence, more, named.reduced, reason, behind)


def _behind(one: Fit, named: Fit) -> str:
    """Why an explanation with better evidence and no objection is not the named one."""
    if _parts(one) > _parts(named):
        return "it acts on more parts of the axis"
    if one.hypothesis.free > named.hypothesis.free:
        return "it has more parameters"
    return "its part of the mismatch is too small for a name"
