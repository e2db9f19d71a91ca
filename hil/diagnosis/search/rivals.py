"""Choose the explanation of a residual to name, and compare the others with it.

The named one is the first that can be the cause. An explanation whose evidence is not worse is tied with it, or there
is an objection to it: a reason beside its evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hil.diagnosis.acceptance import COMPARED, FORM, paying
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Considered, Ledger, accepted, examine, refusal
from hil.diagnosis.search.addition import Addition
from hil.diagnosis.search.initial_values import reads_wrong
from hil.diagnosis.search.next_term import SearchRound, first_standing, ordered
from hil.identification.coordinates import LAST_EDGE_STEP_S
from hil.identification.estimator import Fit, FitStatus
from hil.identification.inference import Filter, bic_gain, bic_margin, refuted, whitening
from hil.identification.terms import Term, is_frequent
from hil.twin.library import BY_ID

# Cost over that of the chosen explanation, up to which the fit of a rival is ended before it is compared, and is
# compared again beside further terms (`search.exchange`).
NEAR = 1.1
ENDED = 40  # evaluations: a fit that starts near its minimum converges within them


@dataclass(frozen=True, eq=False)
class RivalFit:
    """Another explanation of the same residual and the evidence against it (BIC difference; < 0 favours it).

    `reduced` is its mean squared weighted residual, `more` its energy per row in units of noise^2 less that of the
    named explanation, whose mean square is `named`; `by_shape`: the evidence is that of the shapes below the noise, of
    which the energy says nothing: there `more` is the torque that it misses beyond that of the named one, over its
    deviation. `objection` is why it cannot be the cause, `behind` why the other
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
    by_shape: bool = False

    @classmethod
    def of(cls, fit: Fit, evidence: float, more: float = np.inf) -> RivalFit:
        """The explanation by a fit."""
        return cls(fit.terms, fit.reduced, evidence, more)

    def beside(self, named: RivalFit) -> RivalFit:
        """The same beside one of the other explanations, that is named now."""
        more = max(self.more**2 - named.more**2, 0.0) ** 0.5 if self.by_shape else self.more - named.more
        return replace(self, evidence=self.evidence - named.evidence, more=more, named=named.reduced, behind="")

    @property
    def ledger(self) -> Ledger:
        """Answers of the rules that compare it with the named explanation."""
        return examine(COMPARED, self, CRITERIA)

    @property
    def tied(self) -> bool:
        """True if neither its evidence nor an objection refutes it."""
        return accepted(self.ledger)


@dataclass(frozen=True, eq=False)
class Choice:
    """The explanation to name, converged, its rivals, the strongest first, and the ledgers of all of them."""

    named: Addition
    rivals: list[RivalFit]
    considered: tuple[Considered, ...]


def chosen(best: Addition, additions: Sequence[Addition], search: SearchRound) -> Choice:
    """Choose the explanation to name.

    `best` is the first of the additions so far: those near it are ended too, and may then come before it.
    """
    begun = [one for one in additions if one is not best]
    fit = best.fit
    if not fit.jacobian.size:  # only evaluated so far, since the fitted ones were rejected
        fit = replace(fit.estimator, edge_step_s=LAST_EDGE_STEP_S).fit(fit.hypothesis)
    started = best if fit is best.fit else search.addition(fit)
    converged = _ended(started, search)
    best = converged if converged.claimable else started
    others = [_ended(one, search) if one.fit.cost < NEAR * best.fit.cost else one for one in begun]
    order = ordered([best, *(one for one in others if one.possible)])
    best = first_standing([one for one in order if one.fit.jacobian.size]) or best
    standing = [one for one in order if one is not best and one.claimable and not objection(one, best)]
    named = _on_fewest_parts(_simplest(_unless_rare(best, standing), standing), [best, *standing])
    filters = whitening(named.fit)
    compared = [(one, _compared(one, named, filters)) for one in order if one is not named]
    considered = [one.considered for one in others if not one.possible]
    considered += [one.considered.asked(rival.ledger) for one, rival in compared]
    considered.append(replace(named.considered, added=True))
    return Choice(named, sorted((rival for _, rival in compared), key=lambda rival: rival.evidence), tuple(considered))


def ended(fit: Fit) -> Fit:
    """The fit, continued if it ran out of steps: only then its cost refutes it."""
    return fit.refit(ENDED, slopes=fit.jacobian) if fit.status is FitStatus.OUT_OF_STEPS else fit


def objection(one: Addition, named: Addition) -> str:
    """Reason against a term in place of another, whatever it explains; empty if there is none."""
    if reason := refusal(examine(FORM, one, CRITERIA)):
        return reason
    worse = sorted(paying(one.harm) - paying(named.harm))
    return f"with it the training recordings are reproduced worse in {', '.join(worse)}" if worse else ""


def _ended(one: Addition, search: SearchRound) -> Addition:
    fit = ended(one.fit)
    return one if fit is one.fit else search.addition(fit)


def _unless_rare(best: Addition, others: Sequence[Addition]) -> Addition:
    """Return the best; for a rare cause the first other one that is not refuted, if there is one."""
    if not best.rare:
        return best
    margin = partial(bic_margin, filters=whitening(best.fit))
    near = (one for one in others if not one.rare and one.fit.jacobian.size)
    return next((one for one in near if not _refuted(_evidence(best, one, margin), one, best)), best)


def _simplest(best: Addition, others: Sequence[Addition]) -> Addition:
    """Return the explanation with the fewest parameters of those that the evidence does not separate.

    Of two mechanisms with the same torque on every motion the more frequent cause is preferred.
    """
    near = [one for one in others if one.fit.jacobian.size and _evidence(best, one, bic_gain) < CRITERIA.tied]
    return min([best, *near], key=lambda one: (one.rare, one.fit.hypothesis.free, not is_frequent(one.fit.terms[-1])))


def _on_fewest_parts(best: Addition, others: Sequence[Addition]) -> Addition:
    """Return the explanation on the fewest parts of the axis of those that are not refuted.

    What a part does that is found already needs no second cause elsewhere. Of equals an error of the second encoder
    comes first, with which nothing else of the axis changes.
    """
    margin = partial(bic_margin, filters=whitening(best.fit))
    near = [
        one
        for one in others
        if one is not best
        and one.fit.jacobian.size
        and one.fit.hypothesis.free <= best.fit.hypothesis.free
        and not _refuted(_evidence(best, one, margin), one, best)
    ]
    return min(
        [best, *near], key=lambda one: (one.rare, _parts(one), not reads_wrong(one.fit.terms[-1], one.fit.bench))
    )


def _parts(one: Addition) -> int:
    return len({BY_ID[term.effect].element_of(term.variant) for term in one.fit.terms})


def _more(one: Addition, named: Addition) -> float:
    """Energy per row beyond that of the named one; below the noise the torque that it misses more (rms)."""
    if not _by_shape(one, named):
        return (one.fit.cost - named.fit.cost) / named.fit.rows
    return more_torque(one.torque, named.torque)


def more_torque(one: tuple[float, float] | None, other: tuple[float, float] | None) -> float:
    """Torque (rms) that the first of two twins misses beyond the other; infinite where it says nothing of one."""
    if one is None or other is None or not np.isfinite(one[0]):
        return np.inf
    return float(max(one[0] ** 2 - other[0] ** 2, 0.0) ** 0.5)


def _by_shape(one: Addition, named: Addition) -> bool:
    """True below the noise, where a term may only pass less noise than another."""
    return one.log_chance is not None and named.log_chance is not None


def _evidence(named: Addition, one: Addition, margin: Callable[[Fit, Fit], float]) -> float:
    """Evidence for an explanation against another: the margin of their fits, below the noise that of their shapes."""
    if one.log_chance is None or named.log_chance is None:
        return margin(named.fit, one.fit)
    return 2.0 * (one.log_chance - named.log_chance)


def _refuted(evidence: float, one: Addition, named: Addition) -> bool:
    if _by_shape(one, named):
        return evidence >= CRITERIA.tied and _more(one, named) >= CRITERIA.discrepancy
    return refuted(evidence, _more(one, named))


def _compared(one: Addition, named: Addition, filters: Sequence[Filter]) -> RivalFit:
    """Compare an explanation with the named one; what is refuted by its evidence needs no other reason."""
    evidence, more = _evidence(named, one, partial(bic_margin, filters=filters)), _more(one, named)
    reason = "" if _refuted(evidence, one, named) else objection(one, named)
    behind = _behind(one, named) if evidence < 0.0 else ""
    by_shape = _by_shape(one, named)
    return RivalFit(one.fit.terms, one.fit.reduced, evidence, more, named.fit.reduced, reason, behind, by_shape)


def _behind(one: Addition, named: Addition) -> str:
    """Reason why an explanation with better evidence and no objection is not the named one."""
    if not one.claimable:
        return "a more frequent mechanism has the same law at these values"
    if one.rare and not named.rare:
        return "it is a rarer cause of the same"
    if _parts(one) > _parts(named):
        return "it acts on more parts of the axis"
    if one.fit.hypothesis.free > named.fit.hypothesis.free:
        return "it has more parameters"
    return "its part of the mismatch is too small for a name"
