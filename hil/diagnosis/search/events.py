"""Events of a recording as a term of a hypothesis: windows in which a constant force acts, fitted and revised."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.event_detection import BLOCK_S, EDGE, Event, detect, faint, left_over
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import bic_gain
from hil.identification.terms import Term, Window, is_load
from hil.identification.window_fit import fit_windows, window_errors
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.parameter import Role

_ACCELERATES = 0.25  # of the largest acceleration
EVENTS = tuple(mechanism.id for mechanism in LIBRARY if mechanism.transient)


def event_term(effect: str, events: Sequence[Event], ratio: float) -> Term:
    """Make one term of events, all with one effect; the strongest gives its values."""
    mechanism = BY_ID[effect]
    first = max(events, key=lambda one: abs(one.level))
    start, end = mechanism.indices(Role.EDGE)
    values = [0.0] * len(mechanism.parameters)
    values[mechanism.strength], values[start], values[end] = first.level / ratio, first.start_s, first.end_s
    windows = tuple(
        Window(one.run, one.start_s - first.start_s, one.end_s - first.end_s, one.level / first.level) for one in events
    )
    return Term(effect, 0, tuple(values), windows=windows)


def information_criterion(at: Fit, event: Term) -> float:
    """Bayesian information criterion of an event at the parameters of a fit: three values for each window."""
    begun = at.estimator.evaluate(at.hypothesis.with_term(event))
    return float(begun.rows * np.log(begun.cost) + 3 * len(event.windows) * np.log(begun.rows))


def beside_loads(nominal: Fit, fit: Fit) -> Fit:
    """Fit the nominal parameters beside the loads of another fit (events, weight, spring, gravity): what the other
    terms are measured against. A load does not move with the speed, so nothing that it leaves is friction.

    Returns `nominal` without loads.
    """
    loads = [term for term in fit.terms if is_load(term)]
    if not loads:
        return nominal
    hypothesis = nominal.hypothesis
    for term in loads:
        hypothesis = hypothesis.with_term(term)
    return nominal.estimator.fit(hypothesis, evaluations=6)


def revised(fit: Fit) -> Fit:
    """Fit the events of a fit again, also as they show beside its other terms; return the best."""
    index = event_index(fit)
    if index is None:
        return fit
    best = fit_windows(fit)
    events = detect(fit)
    if events:
        shown = event_term(fit.terms[index].effect, events, fit.bench.axis.ratio_m_rad)
        other = fit.hypothesis.replaced(index, shown)
        again = fit_windows(fit.estimator.evaluate(other))
        best = again if bic_gain(again, best) > 0.0 else best
    return trimmed(completed(best if best.cost <= fit.cost or bic_gain(best, fit) > 0.0 else fit))


def joined(at: Hypothesis, index: int, more: Term) -> Hypothesis:
    """The hypothesis with the windows of another term in one of its events."""
    term, mechanism = at.resolved.terms[index], BY_ID[at.terms[index].effect]
    (start, end), strength = mechanism.indices(Role.EDGE), mechanism.strength
    added = tuple(
        Window(
            one.run,
            more.at(one)[start] - term.values[start],
            more.at(one)[end] - term.values[end],
            more.at(one)[strength] / term.values[strength],
        )
        for one in more.windows
    )
    return _with_windows(at, index, (*term.windows, *added))


def completed(fit: Fit, others: bool = True) -> Fit:
    """Add the windows that those of a fit leave, and make one of neighbours, where the evidence supports it."""
    index = event_index(fit)
    if index is None:
        return fit
    more = left_over(fit)
    if more:
        added = event_term(fit.terms[index].effect, more, fit.bench.axis.ratio_m_rad)
        longer = joined(fit.hypothesis, index, added)
        again = fit_windows(fit.estimator.evaluate(longer), others=others)
        fit = again if bic_gain(again, fit) > CRITERIA.evidence * len(more) else fit
    names, refuted = {run.name for run in fit.data.runs}, set[tuple[Window, Window]]()
    while True:
        term = fit.terms[index]
        ordered = sorted((one for one in term.windows if one.run in names), key=lambda one: (one.run, one.later_s))
        pairs = [pair for pair in pairwise(ordered) if pair not in refuted and _touch(term, *pair)]
        if not pairs:
            return fit
        one, two = pairs[0]
        whole = max(one, two, key=lambda part: part.end_later_s - part.later_s)
        whole = whole._replace(later_s=one.later_s, end_later_s=two.end_later_s)
        rest = (other for other in term.windows if other not in (one, two))
        single = _with_windows(fit.hypothesis, index, (*rest, whole))
        fitted = fit_windows(fit.estimator.evaluate(single), others=others)
        if bic_gain(fitted, fit) > 0.0:
            fit = fitted
        else:
            refuted.add((one, two))


def _touch(term: Term, one: Window, two: Window) -> bool:
    """True if a window of the same sign begins where another one ends, as far as the observer tells."""
    gap_s = term.edges(two)[0] - term.edges(one)[1]
    return one.run == two.run and abs(gap_s) < EDGE * BLOCK_S and one.factor * two.factor > 0.0


def _with_windows(at: Hypothesis, index: int, windows: tuple[Window, ...]) -> Hypothesis:
    """The hypothesis with other windows of one of its events."""
    terms = (*at.terms[:index], replace(at.terms[index], windows=windows), *at.terms[index + 1 :])
    return Hypothesis(at.bench, terms, at.x)


def trimmed(fit: Fit, others: bool = True) -> Fit:
    """Leave out windows of the runs of a fit whose force is no larger than its error allows, and fit the others again.

    Such are windows at rest, where friction holds against a force. Faint ones and those without a length are left out
    too.
    """
    index = event_index(fit)
    if index is None:
        return fit
    term, names = fit.hypothesis.terms[index], {run.name for run in fit.data.runs}
    strength = BY_ID[term.effect].strength
    errors = iter(window_errors(fit, index))
    at = fit.hypothesis.resolved.terms[index]
    inside = [one for one in term.windows if one.run in names]
    weak = dict(zip(inside, faint([(*at.edges(one), at.at(one)[strength]) for one in inside]), strict=True))
    kept = tuple(
        one
        for one in term.windows
        if one.run not in names
        or (
            abs(at.at(one)[strength]) > CRITERIA.sigmas * next(errors)[2]
            and not weak[one]
            and at.edges(one)[1] > at.edges(one)[0]
        )
    )
    if len(kept) == len(term.windows):
        return fit
    if not kept:
        return fit.estimator.fit(fit.hypothesis.without(index))
    return fit_windows(fit.estimator.evaluate(_with_windows(fit.hypothesis, index, kept)), others=others)


class InsideWindows(NamedTuple):
    """Motor residuals of a fit with a force: energy inside its windows, `left` and `before` it, and mean squares inside
    and outside [noise^2]; `one_push`: the windows follow each other in one recording; `chance` by which windows that do
    not depend on the motion lie so often where the axis accelerates.

    A force of another form, such as friction at one place, leaves more inside. What happens once is no law of place or
    speed: a blow or a push by hand has any form, of which windows that follow each other explain most.
    """

    left: float
    before: float
    mean: float
    mean_outside: float
    one_push: bool
    chance: float = 1.0


def inside_windows(fit: Fit, base: Fit) -> InsideWindows | None:
    """Measure what the force of a fit leaves within its windows; None without one. `base` is the fit without it."""
    index = event_index(fit)
    if index is None:
        return None
    start, end = BY_ID[fit.terms[index].effect].indices(Role.EDGE)
    term, inside, outside, before = fit.terms[index], list[FloatArray](), list[FloatArray](), 0.0
    for (number, channel), part in fit.residuals.parts.items():
        run = fit.data.runs[number]
        if channel != "motor":
            continue
        time_s, within = run.time_s[run.evaluated], np.zeros(part.size, dtype=bool)
        for one in term.windows:
            if one.run == run.name:
                within |= (time_s >= term.at(one)[start]) & (time_s < term.at(one)[end])
        inside.append(part[within] ** 2)
        outside.append(part[~within] ** 2)
        before += float(np.sum(base.residuals.parts[number, channel][within] ** 2))
    left, rest = np.concatenate(inside), np.concatenate(outside)
    mean, mean_outside = (float(np.mean(part)) if part.size else math.nan for part in (left, rest))
    return InsideWindows(float(np.sum(left)), before, mean, mean_outside, _one_push(term), _chance(fit, term))


def _chance(fit: Fit, term: Term) -> float:
    """Probability that so many windows of an event lie mostly where the axis accelerates, as often as its rows do."""
    start, end = BY_ID[term.effect].indices(Role.EDGE)
    inside, every = list[bool](), list[NDArray[np.bool_]]()
    for run in fit.data.runs:
        # of the set-points, where there are any: a push accelerates the axis too
        acceleration = np.abs(np.gradient(run.velocity_command_m_s))
        accelerates = acceleration > _ACCELERATES * np.max(acceleration, initial=0.0)
        every.append(accelerates[run.evaluated])
        for one in term.windows:
            rows = (run.time_s >= term.at(one)[start]) & (run.time_s < term.at(one)[end])
            if one.run == run.name and rows.any():
                inside.append(bool(2 * np.count_nonzero(accelerates & rows) > np.count_nonzero(rows)))
    share = float(np.mean(np.concatenate(every)))
    return float(binom.sf(sum(inside) - 1, len(inside), share)) if inside else 1.0


def _one_push(term: Term) -> bool:
    """True if the windows of an event follow each other in one recording, as far as the observer tells."""
    edges = sorted(term.edges(one) for one in term.windows)
    ends = np.maximum.accumulate([end_s for _, end_s in edges])
    gaps_s = np.array([start_s for start_s, _ in edges[1:]]) - ends[:-1]
    return len({one.run for one in term.windows}) == 1 and bool(np.all(gaps_s < EDGE * BLOCK_S))


def event_index(fit: Fit) -> int | None:
    return next((index for index, term in enumerate(fit.hypothesis.terms) if term.windows), None)
