"""The next term of the forward selection: race, restarts, and the conditions that a term meets."""

from collections.abc import Callable, Sequence

import numpy as np

from hil.diagnosis.search.events import constant_inside
from hil.diagnosis.search.harm import refuting
from hil.diagnosis.search.initial_values import claimable
from hil.diagnosis.search.restart import companion, from_owner, may_hide, together, unbent
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.successive_halving import race
from hil.diagnosis.wording import channel_names
from hil.identification.estimator import Fit
from hil.identification.inference import against
from hil.identification.noise_floor import REPEATS, unrepeated

Progress = Callable[[str], None]

# BIC differences. "Very strong" evidence is 10 (Kass and Raftery 1995); the search looks at some 45 variants at some
# 90 starts, which costs 2 log 90 = 9 more.
NEEDED = 20.0
# Ablation fits stop early when the cost without the term is > 1.43 x (1 / 0.7) the cost with it; others are iterated to
# convergence. A term that removes less may be the remainder of a hidden effect, which restarts look for.
CLEAR = 0.7
# Least energy that a term removes per row, in units of noise^2: 14 % of the noise in rms. The model discrepancy of two
# simulations of one axis is below that.
MATERIAL = 0.02
# Energy above the noise floor per row, in units of noise^2, below which nothing is left to explain: half of MATERIAL.
_NOTHING = 0.5 * MATERIAL
# Least share of the energy above the noise that a term removes: many terms of less are a series expansion of another
# effect.
WORTH = 0.02
# The same beside `_SEVERAL` terms: if these are right, a further effect is all that is left, not a small part of it.
SERIES, _SEVERAL = 0.1, 2
# Terms that together leave more than this share of the energy above the floor do not explain the mismatch.
MOST = 0.5
# Share of the energy that a term removed from a channel, 1/20 in rms, below which the remainder may be due to another
# form of the same law and not to a second mechanism.
FORM = 0.0025


def next_term(
    base: Fit, owner: Fit, reference: Fit, candidates: Sequence[Candidate], step: Progress
) -> tuple[list[Fit], Fit | None]:
    """Fit the base with one more term; return the fits and the first one with sufficient evidence, if any.

    `reference` is the nominal fit beside the loads of the base. A torque that is sampled, or the only one recorded,
    drives the twin with its error: terms that pass less of it leave less than the noise, so that nothing below the
    floor is evidence.
    """
    if base.at_floor and not base.data.observability.exact_input:
        return [], None
    bits = 1.0 - float(np.exp(-NEEDED / base.rows))  # share of white residuals whose removal gives evidence of NEEDED
    promising = [one for one in candidates if one.share > bits and one.share * base.cost > MATERIAL * base.rows]
    found: list[Fit] = []
    if promising:
        step("fitting " + ", ".join(one.term.effect for one in promising[:3]))
        found = valid(race(base, promising))
    best = worthwhile(found, base, reference, owner)
    unfinished = (best is None or best.cost > CLEAR * base.cost) and not base.estimator.expired
    if unfinished and not owner.at_floor and base.excess > _NOTHING * base.rows and may_hide(base):
        step("fitting a lost preload from the springs of the bench file")
        found = sorted([*found, unbent(base)], key=lambda other: other.cost)
        best = worthwhile(found, base, reference, owner)
    if best is None and not base.at_floor and not base.estimator.expired:
        step("searching again beside the parameters of the bench file")
        found = valid(from_owner(base))
        best = worthwhile(found, base, reference, owner)
    if best is not None and not best.at_floor and not base.estimator.expired and (other := companion(base, best)):
        step(f"fitting {best.terms[-1].effect} together with {other.effect}")
        pairs = [pair for pair in valid(together(base, best, other)) if pair.cost < CLEAR * best.cost]
        found = sorted([*found, *pairs], key=lambda fit: fit.cost)
        best = worthwhile(found, base, reference, owner)
    return found, best


def valid(found: Sequence[Fit]) -> list[Fit]:
    """The fits whose last term has values of its mechanism that the sensors can show."""
    return [other for other in found if claimable(other.terms[-1], other.bench, other.data.runs)]


def worthwhile(found: Sequence[Fit], base: Fit, nominal: Fit, owner: Fit) -> Fit | None:
    """Return the first fit whose last term has evidence and material energy, and can be the cause.

    A fit that is refuted by a channel comes after all others.
    """
    enough = max(MATERIAL * base.rows, (WORTH if len(base.terms) < _SEVERAL else SERIES) * base.excess)
    good = [
        other
        for other in found
        if against(other, base) >= NEEDED and gain(base, other, nominal) >= enough and not ill_formed(other, base)
    ]
    return next((other for other in good if not refuting(other, base, owner)), good[0] if good else None)


def ill_formed(found: Fit, base: Fit) -> str:
    """Why the last term of a fit cannot be the cause, whatever it explains; empty if it can."""
    if REPEATS * unrepeated(found.hypothesis, found.data) > unrepeated(base.hypothesis, base.data):
        return "with it the repeated laps are reproduced worse"
    return "" if constant_inside(found, base) else "the force is not constant within its windows"


def objection(found: Fit, named: Fit, base: Fit, owner: Fit) -> str:
    """Why the last term of a fit cannot be named instead of that of `named`, whatever it explains; empty if it can."""
    names = channel_names(base.bench, base.data.runs[0])
    worse = sorted(names[one] for one in refuting(found, base, owner) - refuting(named, base, owner))
    harm = f"with it the training recordings are reproduced worse in {', '.join(worse)}" if worse else ""
    return ill_formed(found, base) or harm


def gain(without: Fit, found: Fit, nominal: Fit) -> float:
    """Energy that a term removes, by channel, less the share that may be due to the form of the terms before it."""
    parts = (fit.residuals.parts.values() for fit in (without, found, nominal))
    return sum(
        max(float(a @ a - b @ b) - FORM * max(float(n @ n - a @ a), 0.0), 0.0) for a, b, n in zip(*parts, strict=True)
    )
