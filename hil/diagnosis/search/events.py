"""Events of a recording: windows in which a constant force acts, from the disturbance torque that a fit leaves.

Disturbance torque = what errors of inertia and friction explain + a constant level in each window. Both are estimated
in turn. The motion is the measured one: the torque of a loop has the shape of the windows itself.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.search.change_points import Segment, joined, segments, standing_out
from hil.diagnosis.search.disturbance import Disturbance, disturbance
from hil.identification.dataset import Dataset, inertia
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import against
from hil.identification.measured import Measured
from hil.identification.terms import Term, Window, is_load
from hil.identification.window_fit import fit_windows, window_errors
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.parameter import Role

EVENT = next((mechanism for mechanism in LIBRARY if mechanism.transient), None)
_BLOCK_S = 0.005  # an edge to be refined by simulation
_MOST_BLOCKS = 6000  # the time of a partition grows with their square: half a second
_REVERSAL_S = 0.05  # not used about a reversal, where friction is known least
_STANDS_OUT = 5.0  # level over the rms of what the windows leave: 1 in 10^6 of Gaussian blocks
_PENALTY = 20.0  # beside 3 log n of the three values of a window: that of a term in the search (NEEDED)
_SHORTEST, _EDGE = 3, 6  # blocks of the shortest window; blocks in which the observer follows an edge
_ALIKE = 0.25  # levels of adjacent windows that differ less are one
_EVIDENCE = 20.0  # BIC difference for the events of a held-out recording: that of a term in the search (NEEDED)
_MATERIAL = 0.02  # least energy per row that they remove, in units of noise^2: that of a term in the search (MATERIAL)
_SIGMAS = 3.0  # standard errors of the force of a window: 0.3 % of Gaussian ones are above without a force
_OF_CONSTANT = 4.0  # energy per row left inside windows over that outside: twice the rms, for edges between two rows
_OF_BLOW = 0.25  # of the energy inside a window: the best constant leaves 0.19 of half a sine, 0.25 of a triangle
_ROUNDS = 3  # windows found in one round do not count as motion in the next; then they stay
_REWEIGHTED = 40  # iterations of the regression
_LEAST_USUAL = 0.3  # of the blocks without an event: else which level is none cannot be told
_SMOOTH_BLOCKS = 8  # the noise of a block is that of means over 40 ms: longer than the observer remembers


class Event(NamedTuple):
    """A window [s] of a run, by its name, and the level in it, in motor units."""

    run: str
    start_s: float
    end_s: float
    level: float


def without_events(found: Fit) -> Fit:
    """Evaluate a fit without its events."""
    events = [index for index, term in enumerate(found.hypothesis.terms) if term.windows]
    return found.estimator.evaluate(found.hypothesis.without(*events)) if events else found


def event_term(found: Sequence[Event], ratio: float) -> Term:
    """Make one term of events; the strongest gives its values."""
    assert EVENT is not None
    first = max(found, key=lambda one: abs(one.level))
    start, end = EVENT.indices(Role.EDGE)
    values = [0.0] * len(EVENT.parameters)
    values[EVENT.strength], values[start], values[end] = first.level / ratio, first.start_s, first.end_s
    windows = tuple(
        Window(one.run, one.start_s - first.start_s, one.end_s - first.end_s, one.level / first.level) for one in found
    )
    return Term(EVENT.id, 0, tuple(values), windows=windows)


def detect(found: Fit) -> list[Event]:
    """Find the events of all runs of a fit, beside its permanent terms."""
    bare = without_events(found)
    pairs = zip(bare.data.runs, bare.residuals.channels, strict=True)
    return [
        event
        for run, channels in pairs
        if "motor" not in run.unseen
        for event in _of_run(run, disturbance(run, channels["motor"], inertia(bare.bench), bare.data.observer_s))
    ]


def beside_loads(nominal: Fit, found: Fit) -> Fit:
    """Fit the nominal parameters beside the loads of another fit (events, weight, spring, gravity): what the other
    terms are measured against. A load does not move with the speed, so nothing that it leaves is friction.

    Returns `nominal` without loads.
    """
    loads = [term for term in found.terms if is_load(term)]
    if not loads:
        return nominal
    hypothesis = nominal.hypothesis
    for term in loads:
        hypothesis = hypothesis.with_term(term)
    return nominal.estimator.fit(hypothesis, evaluations=6)


def revised(found: Fit) -> Fit:
    """Fit the events of a fit again, also as they show beside its other terms; return the best."""
    index = _index(found)
    if index is None:
        return found
    best = fit_windows(found)
    events = detect(found)
    if events:
        other = found.hypothesis.replaced(index, event_term(events, found.bench.axis.ratio_m_rad))
        again = fit_windows(found.estimator.evaluate(other))
        best = again if against(again, best) > 0.0 else best
    return _trimmed(best if best.cost <= found.cost or against(best, found) > 0.0 else found)


def with_events_of(held_out: Dataset, final: Fit) -> Fit:
    """Add the events of held-out recordings to a fit: its parameters and its own events stay.

    They are those that the disturbance torque shows, or those of the training recordings at the same times, whichever
    the recordings support. An event is no prediction: it is found in each recording.
    """
    if EVENT is None or not held_out.runs:
        return final
    index, at = _index(final), final.hypothesis
    there = replace(final.estimator, data=held_out)
    before = there.evaluate(at)
    choices = list[Term]()
    found, ratio = detect(before), final.bench.axis.ratio_m_rad
    if found:
        choices.append(event_term(found, ratio))
    if index is not None:
        windows = dict.fromkeys(one._replace(run=run.name) for run in held_out.runs for one in at.terms[index].windows)
        choices.append(replace(at.resolved.terms[index], windows=tuple(windows)))
    best, evidence = final, _EVIDENCE
    for choice in choices:
        longer = at.with_term(choice) if index is None else _joined(at, index, choice)
        fitted = _trimmed(fit_windows(there.evaluate(longer), others=False), others=False)
        if _index(fitted) is None or fitted.hypothesis.x.size != longer.x.size:
            continue
        gain = against(fitted, before)
        if gain > evidence and before.cost - fitted.cost > _MATERIAL * before.rows and constant_inside(fitted, before):
            own = final.estimator.residuals(fitted.hypothesis)
            more = np.zeros((final.rows, fitted.hypothesis.x.size - at.x.size))
            slopes = np.hstack([final.jacobian, more]) if final.jacobian.size else final.jacobian
            best = replace(final, hypothesis=fitted.hypothesis, residuals=own, jacobian=slopes)
            evidence = gain
    return best


def _joined(at: Hypothesis, index: int, more: Term) -> Hypothesis:
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
    terms = list(at.terms)
    terms[index] = replace(terms[index], windows=(*term.windows, *added))
    return Hypothesis(at.bench, tuple(terms), at.x)


def _trimmed(found: Fit, others: bool = True) -> Fit:
    """Leave out windows of the runs of a fit whose force is no larger than its error allows, and fit the others again.

    Such are windows at rest, where friction holds against a force.
    """
    index = _index(found)
    if index is None:
        return found
    term, names = found.hypothesis.terms[index], {run.name for run in found.data.runs}
    strength = BY_ID[term.effect].strength
    errors = iter(window_errors(found, index))
    at = found.hypothesis.resolved.terms[index]
    kept = tuple(
        one for one in term.windows if one.run not in names or abs(at.at(one)[strength]) > _SIGMAS * next(errors)[2]
    )
    if len(kept) == len(term.windows):
        return found
    if not kept:
        return found.estimator.fit(found.hypothesis.without(index))
    terms = (*found.hypothesis.terms[:index], replace(term, windows=kept), *found.hypothesis.terms[index + 1 :])
    changed = Hypothesis(found.hypothesis.bench, terms, found.hypothesis.x)
    return fit_windows(found.estimator.evaluate(changed), others=others)


def constant_inside(found: Fit, base: Fit) -> bool:
    """True if a constant force explains the windows of a fit as well as the rest of its recordings is explained.

    A force of another form, such as friction at one place, leaves more inside. What happens once is no law of place or
    speed: a blow has any form, of which a constant explains most. `base` is the fit without the force.
    """
    index = _index(found)
    if index is None:
        return True
    start, end = BY_ID[found.terms[index].effect].indices(Role.EDGE)
    term, inside, outside, before = found.terms[index], list[FloatArray](), list[FloatArray](), 0.0
    for (number, channel), part in found.residuals.parts.items():
        run = found.data.runs[number]
        if channel != "motor":
            continue
        time_s, within = run.time_s[run.judged], np.zeros(part.size, dtype=bool)
        for one in term.windows:
            if one.run == run.name:
                within |= (time_s >= term.at(one)[start]) & (time_s < term.at(one)[end])
        inside.append(part[within] ** 2)
        outside.append(part[~within] ** 2)
        before += float(np.sum(base.residuals.parts[number, channel][within] ** 2))
    left, rest = np.concatenate(inside), np.concatenate(outside)
    once = len(term.windows) == 1 and float(np.sum(left)) <= _OF_BLOW * before
    return once or not left.size or bool(np.mean(left) <= _OF_CONSTANT * max(float(np.mean(rest)), 1.0))


def _index(found: Fit) -> int | None:
    return next((index for index, term in enumerate(found.hypothesis.terms) if term.windows), None)


def _of_run(run: Measured, seen: Disturbance) -> list[Event]:
    seen = Disturbance(seen.torque[run.lead_in :], seen.velocity[run.lead_in :], seen.sliding[run.lead_in :])
    block = max(round(_BLOCK_S / run.period_s), -(-seen.sliding.size // _MOST_BLOCKS), 1)
    rows = seen.sliding.size // block * block
    usable = seen.sliding.copy()
    usable[: run.judged.start - run.lead_in] = False
    turns = np.diff(np.signbit(seen.velocity), append=np.signbit(seen.velocity[-1])).astype(float)
    usable &= np.convolve(turns, np.ones(2 * round(_REVERSAL_S / run.period_s) + 1), "same") < 0.5

    def means(values: FloatArray) -> FloatArray:
        whole = (values * usable)[:rows].reshape(-1, block)
        return np.asarray(whole.sum(axis=1) / np.maximum(known, 1), dtype=np.float64)

    known = usable[:rows].reshape(-1, block).sum(axis=1)
    weights = np.asarray(known >= block / 2, dtype=np.float64)
    values = means(seen.torque)
    speed = means(seen.velocity) / max(float(np.abs(seen.velocity).max()), 1e-300)
    acceleration = means(np.gradient(seen.velocity, run.period_s))
    columns = np.stack([np.ones(speed.size), np.sign(speed), speed, np.abs(speed), acceleration], axis=1)
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    usual = weights
    for _ in range(_ROUNDS):
        rest = values - _explained(columns, values, usual)
        found = standing_out(rest, weights, _windows(rest, weights), _STANDS_OUT, _EDGE)
        usual = weights.copy()
        for one in found:
            usual[one.first : one.last] = 0.0
        if usual.sum() < _LEAST_USUAL * weights.sum():
            return []
    at_s, length_s = run.time_s[run.lead_in], block * run.period_s
    return [Event(run.name, at_s + one.first * length_s, at_s + one.last * length_s, one.level) for one in found]


def _explained(columns: FloatArray, values: FloatArray, weights: FloatArray) -> FloatArray:
    """Part of values (n,) that columns (n, k) explain; least absolute deviations, which windows do not shift."""
    weight = weights
    for _ in range(_REWEIGHTED):
        solved, *_ = np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=1e-9)
        left = np.abs(values - columns @ solved)
        least = 1e-3 * float(np.median(left[weights > 0.0])) + 1e-300
        weight = weights / np.sqrt(np.maximum(left, least))
    return np.asarray(columns @ solved, dtype=np.float64)


def _windows(rest: FloatArray, weights: FloatArray) -> list[Segment]:
    """Windows of constant level in a signal (n,)."""
    size = rest.size // _SMOOTH_BLOCKS * _SMOOTH_BLOCKS
    if not size or weights.sum() < 2 * _SMOOTH_BLOCKS:
        return []
    smoothed = (rest * weights)[:size].reshape(-1, _SMOOTH_BLOCKS).mean(axis=1)
    noise = 1.4826 * float(np.median(np.abs(np.diff(smoothed)))) * np.sqrt(_SMOOTH_BLOCKS / 2.0)
    if noise <= 0.0:
        return []
    cut = joined(segments(rest, weights, noise**2, 3.0 * np.log(rest.size) + _PENALTY), weights, _EDGE, _ALIKE)
    return [one for one in cut if weights[one.first : one.last].sum() >= _SHORTEST]
