"""Forward selection of mechanisms, with their rivals.

Terms are added one at a time from the whole library while the evidence supports them. After every addition the terms
that are no longer needed are removed: a first term may have imitated two causes that are found later.
"""

import math
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hil.diagnosis.acceptance import NEEDED, VALUES
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Considered, accepted, examine
from hil.diagnosis.search.addition import removed
from hil.diagnosis.search.events import beside_loads, revised
from hil.diagnosis.search.exchange import exchanged
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.search.initial_values import claimable
from hil.diagnosis.search.next_term import Additions, SearchRound, first_standing, next_term
from hil.diagnosis.search.refits import carried, less_torque, noisy_springs, over
from hil.diagnosis.search.restart import again
from hil.diagnosis.search.rivals import ENDED, RivalFit, chosen, ended
from hil.diagnosis.search.score_test import screen_library
from hil.diagnosis.search.shape import log_chance_below_noise
from hil.diagnosis.stages import Prepared, Progress, Searched
from hil.identification.estimator import Fit
from hil.identification.inference import bic_gain, bic_margin, standard_errors, whitening
from hil.identification.internal_steps import longest_steps
from hil.identification.noise_apart import noise_apart
from hil.identification.nominal_fit import fit_nominal_parameters, require_finite
from hil.identification.parallel import in_parallel
from hil.identification.terms import Key, Term, compatible, effects, free_slot
from hil.identification.torque_left import fit_plain, mismatch_left
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.physics import Active

MOST_TERMS = 8  # at once: more than an engineer can act on; limits the duration of a search
_INPUT = 1e-6  # rms over noise below which a channel is fed to the twin as it is, and tells nothing


@dataclass(frozen=True)
class Need:
    """Need of a term beside all others: evidence (BIC difference), energy it removes from a channel over its noise.

    `log_chance`: logarithm of the chance of its shape below the noise (`search.shape`); None above it.
    """

    evidence: float
    removed: float
    log_chance: float | None


@dataclass(frozen=True, eq=False)
class _Explanation:
    """A fit without terms that are not needed, the need of each, and their rivals."""

    fit: Fit
    needed: dict[Key, float]
    rivals: dict[Key, list[RivalFit]]


def _grown(
    additions: Additions, round_: SearchRound, nominal: Fit, tried: Collection[Sequence[tuple[str, int]]]
) -> tuple[_Explanation | None, list[Considered]]:
    """Add the best of the terms that stand; one that is removed again gives its place to the next.

    None where all are removed again, or lead to what was `tried`. Returns the ledgers too.
    """
    best, left, considered = additions.best, additions.fits, list[Considered]()
    while best is not None:
        choice = chosen(best, left, round_)
        considered += choice.considered
        effect = choice.named.fit.terms[-1].effect
        fit, needed, pruned = _pruned(choice.named.fit, round_.reference)
        considered += pruned
        # to convergence: the residual of an unfinished fit resembles other mechanisms
        fit = fit.refit(ENDED, slopes=fit.jacobian)
        considered += [Considered.of(fit.terms, examine(VALUES, False, CRITERIA), index) for index in _invalid(fit)]
        fit = revised(claimed(fit))
        better = not fit.terms and fit.cost < nominal.cost - CRITERIA.evidence
        if better or effects(fit.terms) not in tried:
            return _Explanation(fit, needed, {choice.named.fit.terms[-1].key: choice.rivals}), considered
        left = [one for one in left if one.fit.terms[-1].effect != effect]
        best = first_standing(left)
    return None, [*considered, *(one.considered for one in left)]


def search(prepared: Prepared, progress: Progress = lambda text: None, deadline_s: float = math.inf) -> Searched:
    """Search for the mechanisms that the twin of a bench lacks on the training recordings.

    After `deadline_s` of processor time the search ends with the best explanation so far. Raises HilError if the twin
    of the axis is unstable.
    """
    stopped_at = ""

    def step(text: str) -> None:
        nonlocal stopped_at
        if time.process_time() > deadline_s:
            stopped_at = stopped_at or text
        else:
            progress(text)

    step("refitting the nominal parameters")
    base = fit_nominal_parameters(prepared.train, deadline_s=deadline_s)
    require_finite(base)
    prepared = prepared.with_steps(longest_steps(base, prepared.held_out))
    base = carried(prepared.train, base)
    given, nominal = base.estimator.evaluate(base.hypothesis.given), base
    begun = given, nominal
    rivals, needed, considered = dict[Key, list[RivalFit]](), dict[Key, float](), list[Considered]()
    tried, fitted, exchanged_from = [effects(())], set[str](), list[_Explanation]()
    while len(base.terms) < MOST_TERMS:
        begins = not base.terms or bool(base.data.set_aside)  # what was found above the noise, rows at rest may tell
        apart = noisy_springs(base.data) or (begins and base.within_noise and not base.data.apart)
        if apart and (plain := fit_plain(base.data)):
            begin = base if base.terms else less_torque(plain, given, base)
            quiet = noise_apart(base.data, begin.hypothesis, plain)
            base, given = over(quiet, begin), carried(quiet, given)
            nominal = over(quiet, nominal) if base.terms else base
        step(f"screening the library beside {len(base.terms)} terms")
        if stopped_at:
            break
        round_ = SearchRound(base, beside_loads(nominal, base), given)
        additions = next_term(round_, screen_library(base), step)
        fitted = {one.fit.terms[-1].effect for one in additions.fits if not base.estimator.expired}
        considered += additions.considered
        added, more = _grown(additions, round_, nominal, tried)
        considered += more
        if added is None:
            known = rivals
            other = exchanged(base, rivals, nominal, given)
            rivals, considered = other.rivals, [*considered, *other.considered]
            if effects(other.fit.terms) not in tried:
                step("searching on with another mechanism in the place of one")
                exchanged_from.append(_Explanation(base, needed, known))
                base, needed, pruned = _pruned(other.fit, beside_loads(nominal, other.fit))
                base, considered = claimed(base), [*considered, *pruned]
                tried.append(effects(other.fit.terms))
                continue
            if not (beside := _beside_unexplained(base, nominal, given)):
                break
            step("searching the channels that are explained, beside those that are not")
            base, nominal, given = beside
            continue
        del additions  # their residuals are not needed any more
        base, needed = added.fit, added.needed
        rivals |= added.rivals
        if not base.terms:
            nominal = base  # the term has only led the nominal parameters out of a local minimum
            continue
        tried.append(effects(base.terms))
        base, nominal, given, prepared = _with_finer_steps(base, nominal, given, prepared)
        if len(base.terms) >= CRITERIA.in_vain and mismatch_left(nominal, base, base.data) > CRITERIA.most_left:
            if not (beside := _beside_unexplained(base, nominal, given)):
                break
            base, nominal, given = beside
    found = _best(_Explanation(base, needed, rivals), exchanged_from)
    base, needed, rivals = found.fit, found.needed, found.rivals
    step("fitting the explanation to convergence")
    final = ended(again(revised(base).refit(ENDED), ENDED))
    final, _, _, prepared = _with_finer_steps(final, nominal, given, prepared)
    if begun[0].data.steps != prepared.train.steps:
        begun = carried(prepared.train, begun[0]), carried(prepared.train, begun[1])
    kept = {term.key for term in final.terms}
    present = {*fitted, *(term.effect for term in final.terms)}
    not_tried = tuple(one.id for one in LIBRARY if one.id not in present) if stopped_at else ()
    rivals = {key: value for key, value in rivals.items() if key in kept}
    given, nominal, final = (fit.without_deadline() for fit in (*begun, final))
    return Searched(prepared, given, nominal, final, rivals, needed, tuple(considered), stopped_at, not_tried)


def _with_finer_steps(base: Fit, nominal: Fit, given: Fit, prepared: Prepared) -> tuple[Fit, Fit, Fit, Prepared]:
    """The fits with internal steps as fine as the terms of the base ask: a nut in a gap asks for finer ones."""
    steps = longest_steps(base, prepared.held_out)
    if steps.fine_s >= base.data.steps.fine_s:
        return base, nominal, given, prepared
    data = replace(base.data, steps=steps)
    return over(data, base), carried(data, nominal), carried(data, given), prepared.with_steps(steps)


def _best(last: _Explanation, others: Sequence[_Explanation]) -> _Explanation:
    """The last explanation, or one of the `others`, which an exchange of terms left, if that is refuted beside it."""
    best = last
    for one in others:
        if one.fit.data is best.fit.data and bic_margin(one.fit, best.fit) >= CRITERIA.tied:
            best = one
    return best


def _beside_unexplained(base: Fit, nominal: Fit, given: Fit) -> tuple[Fit, Fit, Fit] | None:
    """The fits with what unexplained channels leave counted as noise; None if there is no such channel any more."""
    factors, known = unexplained_channels(base), base.data.set_aside
    if set(factors) <= set(known):
        return None
    louder = base.data.louder({name: value * known.get(name, 1.0) for name, value in factors.items()} | dict(known))
    return over(louder, base), over(louder, nominal), over(louder, given)


def unexplained_channels(fit: Fit) -> dict[str, float]:
    """Factor on the noise of each channel that a fit does not explain, where it explains another; else empty.

    What is left of such a channel counts as noise, so that it decides nothing of the others.
    """
    rms = {name: max(ratios[name] for ratios in fit.noise_ratios) ** 0.5 for name in fit.noise_ratios[0]}
    floor = CRITERIA.floor if fit.data.observability.exact_input else CRITERIA.coloured
    left = {name: value for name, value in rms.items() if value**2 > floor}
    inputs = {name for name, value in rms.items() if value < _INPUT}
    return left if set(rms) - set(left) - inputs - fit.data.observability.hidden else {}


def _without(fit: Fit, index: int) -> Fit:
    """Fit the hypothesis without one of the terms, in few evaluations."""
    slopes = np.delete(fit.jacobian, fit.hypothesis.columns(index), axis=1)
    return fit.estimator.fit(fit.hypothesis.without(index), evaluations=6, slopes=slopes)


def claimed(fit: Fit) -> Fit:
    """Remove the terms whose values are not valid for their mechanism; where these are another's, that takes its place.

    A spring that rests out of reach is a weight. So is one whose stiffness does not differ from none, and gravity over
    so short an arc that its size does not.
    """
    while True:
        lost = _invalid(fit)
        if not lost:
            return fit
        other = _beyond(fit, lost[0])
        if other is None:
            rest = _without(fit, lost[0])
            fit = rest.refit(ENDED, slopes=rest.jacobian)
        else:
            fit = fit.estimator.fit(fit.hypothesis.replaced(lost[0], other), evaluations=ENDED)


def _invalid(fit: Fit) -> list[int]:
    """Indices of the terms whose values are not valid for their mechanism, or not told apart from its limit."""
    return [
        index
        for index, term in enumerate(fit.terms)
        if not claimable(term, fit.bench, fit.data.runs) or _at_limit(fit, index)
    ]


def _at_limit(fit: Fit, index: int) -> bool:
    """True for a term with a limit that is another mechanism, whose strength is within its standard errors of none."""
    term, mechanism = fit.terms[index], BY_ID[fit.terms[index].effect]
    if mechanism.beyond is None or not fit.jacobian.size:
        return False
    error = standard_errors(fit)[fit.hypothesis.columns(index)][mechanism.strength]
    return mechanism.size(term.values, axis_facts(fit.bench, fit.data.runs)) < CRITERIA.sigmas * error


def _beyond(fit: Fit, index: int) -> Term | None:
    """The mechanism that a term is outside of its own valid values; None if it cannot stand beside the others."""
    term, mechanism = fit.terms[index], BY_ID[fit.terms[index].effect]
    if mechanism.beyond is None:
        return None
    others: list[Term | Active] = [
        *fit.terms[:index],
        *fit.terms[index + 1 :],
        *(entry.active() for entry in fit.hypothesis.kept),
    ]
    effect, values = mechanism.beyond(term.values, axis_facts(fit.bench, fit.data.runs))
    other = Term(effect, 0, values, slot=free_slot(effect, fit.terms))
    return other if compatible([*others, other]) else None


def _pruned(fit: Fit, reference: Fit) -> tuple[Fit, dict[Key, float], list[Considered]]:
    """Remove terms without evidence, weakest first.

    Returns the fit, the evidence for the remaining terms, and the ledgers of those that were removed.
    """
    pruned = list[Considered]()

    def ablated(index: int) -> tuple[float, Fit]:
        other = _without(fit, index)
        if fit.cost > CRITERIA.clear * other.cost:
            other = other.refit(ENDED, slopes=other.jacobian)
        return bic_gain(fit, other, filters), other

    while fit.terms:
        filters = whitening(fit)
        pairs = in_parallel([partial(ablated, index) for index in range(len(fit.terms))])
        weakest = min(range(len(pairs)), key=lambda index: pairs[index][0])
        evidence, rest = pairs[weakest]
        need = Need(evidence, removed(rest, fit, reference), log_chance_below_noise(fit, rest))
        ledger = examine(NEEDED, need, CRITERIA)
        if accepted(ledger):
            return fit, {term.key: value for term, (value, _) in zip(fit.terms, pairs, strict=True)}, pruned
        pruned.append(Considered.of(fit.terms, ledger, weakest))
        fit = rest
    return fit, {}, pruned
