"""From recordings to an explanation: how many mechanisms, which, their rivals, and what stays unexplained.

Terms are added one at a time while the evidence asks for them, each against the whole library. After every
addition the terms that are no longer needed are dropped, so that a first guess that only imitated two
causes goes once both are there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hil.bench.bench_file import Bench
from hil.diagnosis.estimation.fit import Fit, evaluate, fit, in_parallel
from hil.diagnosis.estimation.hypothesis import LAST_EDGE_STEP_S
from hil.diagnosis.estimation.model_comparison import against, whitening
from hil.diagnosis.estimation.noise_floor import REPEATS, Laps, all_laps, unrepeated
from hil.diagnosis.estimation.terms import FRICTION, Key, Term
from hil.diagnosis.search import successive_halving
from hil.diagnosis.search.restart import from_owner, may_hide, unbent
from hil.diagnosis.search.score_test import Lead
from hil.diagnosis.search.validity import claimable
from hil.identification.dataset import Measured

Progress = Callable[[str], None]

MOST_TERMS = 8  # at once; more than an engineer could act on, and the search stays affordable
# BIC differences. "Very strong" evidence is 10 (Kass and Raftery 1995); the search looks at some 45 variants at some
# 90 starts, which costs 2 log 90 = 9 more.
NEEDED = 20.0
TIED = 10.0  # a rival closer than this is not refuted
# A fit without a term that leaves so much more than the one with it, 1 / 0.7, is not carried to its end: more steps
# would change the number, not the answer. Nearer ones are. What takes less away may be the rest of something hidden.
_CLEAR = 0.7
# A term must also matter: take so much energy away, in units of the noise's: 14 % of the noise in rms.
# Below lie the details in which two honest simulations of one axis differ.
MATERIAL = 0.02
# And so much of what is left above the noise: one mechanism after the other that each explain next to nothing are a
# series expansion of something else.
WORTH = 0.02
# Terms that together leave more than this of what is above the floor are a fit, not an explanation: more of the
# mismatch is not understood than is. After so many of them the search ends.
MOST, _IN_VAIN = 0.5, 3
_ENDED = 40  # evaluations, within which a fit that began near its end gets there
# The same law may be written in another form. What a term leaves below this share of the energy that it took from a
# channel, a twentieth in rms, may be its own form, and no second mechanism.
FORM = 0.0025

# A rival that leaves no more than this beside the best is not refuted either, whatever the evidence: a quarter of what
# is material, 7 % of the noise in rms. A simulation of the axis by someone else differs by as much.
ALIKE = 0.25 * MATERIAL


@dataclass(frozen=True, eq=False)
class Rival:
    """Another explanation of the same residual, the evidence against it (BIC difference), and the energy that it
    leaves beyond, per row in units of the noise's."""

    fit: Fit
    evidence: float
    more: float = np.inf

    @property
    def tied(self) -> bool:
        """Whether it is not refuted."""
        return self.evidence < TIED or self.more < ALIKE


@dataclass(frozen=True, eq=False)
class Explanation:
    """What was found: the owner's values, the nominal refit, the final fit and the rivals of each term."""

    owner: Fit
    nominal: Fit
    final: Fit
    rivals: dict[Key, list[Rival]] = field(default_factory=dict)
    needed: dict[Key, float] = field(default_factory=dict)  # evidence that each term is needed
    leads: tuple[Lead, ...] = ()  # of the first screen

    @property
    def terms(self) -> tuple[Term, ...]:
        """The mechanisms found, with their fitted values."""
        return self.final.model.resolved(self.final.x)[1]


def explain(bench: Bench, runs: Sequence[Measured], progress: Progress = lambda text: None) -> Explanation:
    """Search for the physics that the twin of `bench` lacks on these recordings."""
    progress("refitting the nominal parameters")
    base = successive_halving.nominal(bench, runs)
    owner = evaluate(base.model, runs)
    nominal, rivals, needed, first_leads = base, dict[Key, list[Rival]](), dict[Key, float](), list[Lead]()
    repeated = all_laps(runs)
    tried = [_kinds(base)]
    while len(base.model.terms) < MOST_TERMS:
        progress(f"screening the library beside {len(base.model.terms)} terms")
        leads = [
            lead
            for lead in successive_halving.leads(base, runs)
            if claimable(lead.term, base.model.resolved(base.x)[0])
        ]
        first_leads = first_leads or leads
        rows = base.residuals.size
        promising = [lead for lead in leads if lead.share > _bits(rows) and lead.share * base.cost > MATERIAL * rows]
        found: list[Fit] = []
        if promising:
            progress("fitting " + ", ".join(lead.term.effect for lead in promising[:3]))
            found = [
                other
                for other in successive_halving.race(base, promising, runs)
                if claimable(_last(other), other.model.resolved(other.x)[0])
            ]
        best = _worthwhile(found, base, nominal, repeated)
        if (best is None or best.cost > _CLEAR * base.cost) and not owner.at_floor and may_hide(base, runs):
            progress("fitting what bent springs may hide")
            found = sorted([*found, unbent(base, runs)], key=lambda other: other.cost)
            best = _worthwhile(found, base, nominal, repeated)
        if best is None and not base.at_floor and excess(base) > MOST * excess(nominal):
            progress("searching again beside the owner's values")
            found = [
                other for other in from_owner(base, runs) if claimable(_last(other), other.model.resolved(other.x)[0])
            ]
            best = _worthwhile(found, base, nominal, repeated)
        if best is None:
            break
        best = _simplest([best, *(other for other in found if other is not best and against(best, other) < TIED)])
        found = [other for other in found if other is not best]
        if not best.jacobian.size:  # a rival that was not fitted to its end, before another was refused
            best = fit(replace(best.model, edge_step_s=LAST_EDGE_STEP_S), runs, best.x)
        filters = whitening(best)
        rivals[best.model.terms[-1].key] = sorted(
            (Rival(other, against(best, other, filters), (other.cost - best.cost) / rows) for other in found),
            key=lambda rival: rival.evidence,
        )
        best, needed = _pruned(best, nominal, runs)
        # to its end: what a fit that is on its way leaves looks like something else
        base = claimed(fit(best.model, runs, best.x, evaluations=_ENDED, slopes=best.jacobian), runs)
        if _kinds(base) in tried:
            break  # what was added went again
        tried.append(_kinds(base))
        if len(base.model.terms) >= _IN_VAIN and excess(base) > MOST * excess(nominal):
            break
    final = fit(base.model, runs, base.x, evaluations=_ENDED)
    kept = {term.key for term in final.model.terms}
    return Explanation(
        owner, nominal, final, {key: value for key, value in rivals.items() if key in kept}, needed, tuple(first_leads)
    )


def _worthwhile(found: Sequence[Fit], base: Fit, nominal: Fit, repeated: Sequence[tuple[Measured, Laps]]) -> Fit | None:
    """The first that explains so much more than the base that its last term is asked for, and repeats as well."""
    enough = max(MATERIAL * base.residuals.size, WORTH * excess(base))
    differs = unrepeated(base, repeated)
    return next(
        (
            other
            for other in found
            if against(other, base) >= NEEDED
            and gain(base, other, nominal) >= enough
            and REPEATS * unrepeated(other, repeated) <= differs
        ),
        None,
    )


def gain(without: Fit, found: Fit, nominal: Fit) -> float:
    """Energy that a term takes away, channel by channel beyond what may be the form of the terms before it."""
    return sum(
        max(float(a @ a - b @ b) - FORM * max(float(n @ n - a @ a), 0.0), 0.0)
        for a, b, n in zip(without.parts, found.parts, nominal.parts, strict=True)
    )


def excess(found: Fit) -> float:
    """Energy above that of the noise."""
    return sum(max(float(part @ part) - part.size, 0.0) for part in found.parts)


def _bits(rows: int) -> float:
    """Share of white residuals that evidence of NEEDED takes away."""
    return 1.0 - float(np.exp(-NEEDED / rows))


def _kinds(found: Fit) -> list[tuple[str, int]]:
    """Effect and variant of each term, whatever their order."""
    return sorted((term.effect, term.variant) for term in found.model.terms)


def _simplest(tied: list[Fit]) -> Fit:
    """Of explanations that the evidence does not tell apart, the one with the fewest parameters. A constant torque
    and friction that differs by direction, alike at every speed, are the same on every motion: the second is named,
    most axes lie flat."""
    return min(tied, key=lambda found: (found.x.size, _last(found).key[:2] != (FRICTION, 0)))


def _last(found: Fit) -> Term:
    return found.model.resolved(found.x)[1][-1]


def _ablated(found: Fit, runs: Sequence[Measured]) -> dict[Key, tuple[float, Fit]]:
    """For each term: the evidence for it, and the fit without it, to the end where that may decide."""
    filters = whitening(found)

    def without(index: int) -> tuple[float, Fit]:
        other = _without(found, index, runs)
        if found.cost > _CLEAR * other.cost:
            other = fit(other.model, runs, other.x, evaluations=12, slopes=other.jacobian)
        return against(found, other, filters), other

    fits = in_parallel([partial(without, index) for index in range(len(found.model.terms))])
    return {term.key: result for term, result in zip(found.model.terms, fits, strict=True)}


def _without(found: Fit, index: int, runs: Sequence[Measured]) -> Fit:
    """A first fit without one of the terms."""
    terms = found.model.terms
    first = found.model.nominal_count + sum(len(term.values) for term in terms[:index])
    columns = slice(first, first + len(terms[index].values))
    return fit(
        replace(found.model, terms=terms[:index] + terms[index + 1 :]),
        runs,
        np.delete(found.x, columns),
        evaluations=6,
        slopes=np.delete(found.jacobian, columns, axis=1),
    )


def claimed(found: Fit, runs: Sequence[Measured]) -> Fit:
    """The fit without the terms whose values beside the others are no longer what their names say."""
    while True:
        bench, terms = found.model.resolved(found.x)
        lost = next((index for index, term in enumerate(terms) if not claimable(term, bench)), None)
        if lost is None:
            return found
        rest = _without(found, lost, runs)
        found = fit(rest.model, runs, rest.x, evaluations=_ENDED, slopes=rest.jacobian)


def _pruned(found: Fit, nominal: Fit, runs: Sequence[Measured]) -> tuple[Fit, dict[Key, float]]:
    """Remove the terms that the evidence does not support, weakest first; the fit and the evidence for the others."""
    while True:
        ablated = _ablated(found, runs)
        evidence, rest = min(ablated.values(), key=lambda pair: pair[0])
        if len(ablated) == 1 or (evidence >= NEEDED and gain(rest, found, nominal) >= MATERIAL * found.residuals.size):
            return found, {key: value for key, (value, _) in ablated.items()}
        found = rest
