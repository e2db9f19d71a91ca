"""The next term of the forward selection: race, restarts, and the conditions that a term meets."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil.diagnosis.acceptance import promises
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Considered, accepted
from hil.diagnosis.search.addition import Addition
from hil.diagnosis.search.by_shape import fitted, shown
from hil.diagnosis.search.restart import companion, from_bench_file, may_hide, together, unbent
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.successive_halving import race
from hil.diagnosis.stages import Progress
from hil.identification.estimator import Fit


@dataclass(frozen=True, eq=False)
class SearchRound:
    """One round of the search: what a further term is added to, and measured against (see `Addition`)."""

    base: Fit
    reference: Fit
    given: Fit

    def addition(self, fit: Fit) -> Addition:
        """A fit with one more term than the base."""
        return Addition(fit, self.base, self.reference, self.given)

    @property
    def unfinished(self) -> bool:
        """True while there is time to fit on."""
        return not self.base.estimator.expired


@dataclass(frozen=True, eq=False)
class Additions:
    """Fits with one more term, best first, the one to name, and the ledgers of those that were given up."""

    fits: list[Addition]
    best: Addition | None
    considered: tuple[Considered, ...] = ()


def next_term(search: SearchRound, candidates: Sequence[Candidate], step: Progress) -> Additions:
    """Fit the base with one more term.

    A torque that is sampled, or the only one recorded, drives the twin with its error: terms that pass less of it leave
    less than the noise, so that below the floor nothing but the shape of a term is evidence.
    """
    base, considered, additions = search.base, list[Considered](), list[Addition]()

    def possible(fits: Sequence[Fit]) -> list[Addition]:
        begun = [search.addition(fit) for fit in fits]
        considered.extend(one.considered for one in begun if not one.possible)
        return ordered([one for one in begun if one.possible])

    def pairs(one: Addition) -> list[Addition]:
        other = None if one.fit.at_floor or not search.unfinished else companion(base, one.fit)
        if other is None:
            return []
        step(f"fitting {one.fit.terms[-1].effect} together with {other.effect}")
        found = possible(together(base, one.fit, other))
        clear = [pair for pair in found if pair.fit.cost < CRITERIA.clear * one.fit.cost]
        considered.extend(pair.considered for pair in found if pair not in clear)
        return clear

    if base.within_noise:
        promising = shown(base, candidates)
        if not promising:
            return Additions([], None)
    else:
        promising = [one for one in candidates if promises(one.by_channel, base.residuals.by_channel)]
    if promising:
        step("fitting " + ", ".join(one.term.effect for one in promising[:3]))
        additions = possible((fitted if base.within_noise else race)(base, promising))
    best = first_standing(additions)
    unclear = best is None or best.fit.cost > CRITERIA.clear * base.cost
    if (
        unclear
        and search.unfinished
        and not search.given.at_floor
        and base.excess > CRITERIA.nothing * base.rows
        and may_hide(base)
    ):
        step("fitting mechanisms that springs may hide from the springs of the bench file")
        additions = ordered([*additions, search.addition(unbent(base))])
        best = first_standing(additions)
    if best is None and additions:  # neither of two that belong together may stand without the other
        additions = ordered([*additions, *pairs(min(additions, key=lambda one: one.fit.cost))])
        best = first_standing(additions)
    # a refit that ends at its bounds may have been led astray by what is missing; with a term that leaves nothing it
    # was not
    stuck = not base.terms and bool(set(base.at_bound).intersection(base.hypothesis.nominal))
    astray = best is None or (stuck and best.fit.excess > CRITERIA.nothing * best.fit.rows)
    if astray and not base.at_floor and search.unfinished:
        step("searching again beside the parameters of the bench file")
        additions = ordered([*additions, *possible(from_bench_file(base))])
        best = first_standing(additions)
    if best is not None:
        additions = ordered([*additions, *pairs(best)])
        best = first_standing(additions)
    return Additions(additions, best, tuple(considered))


def first_standing(additions: Sequence[Addition]) -> Addition | None:
    """The first addition that stands; one with which a channel pays for another comes after all others."""
    standing = [one for one in additions if one.stands]
    return next((one for one in standing if accepted(one.harmless)), standing[0] if standing else None)


def ordered(additions: Sequence[Addition]) -> list[Addition]:
    """Additions, best first: by their evidence; below the noise by the chance of their shape.

    Of what another effect leaves, slow and large, a wrong term may remove more energy than the right one.
    """
    return sorted(additions, key=lambda one: (one.log_chance or 0.0, -one.evidence))
