"""Events of all recordings: those that a search leaves in training, and those of held-out recordings.

An event is no prediction: it is found in each recording. It is what the disturbance torque shows, or what the torque
tells by least squares, and stands where the motion has evidence for it, and the force is constant in its windows.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.diagnosis.acceptance import is_event
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.event_detection import Event, detect
from hil.diagnosis.search.events import (
    EVENTS,
    completed,
    event_index,
    event_term,
    inside_windows,
    joined,
    trimmed,
)
from hil.diagnosis.search.force_windows import torque_windows
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import bic_gain
from hil.identification.terms import Term
from hil.identification.window_fit import fit_windows


def with_events(final: Fit, held_out: Dataset) -> Fit:
    """Add the events that a fit leaves to it: those that the torque tells in training, and all of held-out recordings.

    The parameters of the fit stay beside the latter.
    """
    if not EVENTS:
        return final
    told = _untold(final, held_out)
    own, others = ([one for one in told if one.run in _names(data)] for data in (final.data, held_out))
    final = _best(final, _terms(final, own), (), own=True) or final
    return _with_those_of(held_out, final, others) if held_out.runs else final


def _untold(final: Fit, held_out: Dataset) -> list[Event]:
    """Forces that the torque tells in all recordings, but for those that a fit has."""
    told = torque_windows(final, final.data.over((*final.data.runs, *held_out.runs)))
    return [one for one in told if not _known(final, one)]


def _names(data: Dataset) -> set[str]:
    return {run.name for run in data.runs}


def _known(fit: Fit, event: Event) -> bool:
    """True for an event within a window that a fit has."""
    index = event_index(fit)
    if index is None:
        return False
    term = fit.hypothesis.resolved.terms[index]
    edges = [term.edges(one) for one in term.windows if one.run == event.run]
    return any(start_s < event.end_s and event.start_s < end_s for start_s, end_s in edges)


def _with_those_of(held_out: Dataset, final: Fit, told: Sequence[Event]) -> Fit:
    """Add the events of held-out recordings to a fit: its parameters and its own events stay.

    They are those that the torque tells, those that the disturbance torque shows, beside the terms of the fit or beside
    the nominal twin, or those of the training recordings at the same times, whichever the recordings support best.
    """
    index, at = event_index(final), final.hypothesis
    before = replace(final.estimator, data=held_out).evaluate(at)
    if index is None and not told and (before.within_noise or before.at_floor):
        return final
    plain = before.estimator.evaluate(at.without(*range(len(at.terms))))
    # terms may depend on the motion, which strong events disturb: some show only beside the nominal twin
    shown = [detect(beside) for beside in ((before, plain) if at.terms else (before,))]
    choices = [term for events in shown for term in _terms(final, events)]
    if index is not None:
        windows = dict.fromkeys(one._replace(run=run.name) for run in held_out.runs for one in at.terms[index].windows)
        choices.append(replace(at.resolved.terms[index], windows=tuple(windows)))
    best = _best(before, _terms(final, told), choices, own=False)
    if best is None:
        return final
    own = final.estimator.residuals(best.hypothesis)
    more = np.zeros((final.rows, best.hypothesis.x.size - at.x.size))
    slopes = np.hstack([final.jacobian, more]) if final.jacobian.size else final.jacobian
    return replace(final, hypothesis=best.hypothesis, residuals=own, jacobian=slopes)


def _terms(fit: Fit, events: Sequence[Event]) -> list[Term]:
    return [event_term(effect, events, fit.bench.axis.ratio_m_rad) for effect in EVENTS if events]


def _best(before: Fit, told: Sequence[Term], shown: Sequence[Term], own: bool) -> Fit | None:
    """The event with most evidence, of those that the torque tells and those that it shows; None where none stands.

    They are fitted with all else (`own`) or alone. What the torque tells stands at its own values too: it needs no
    smaller errors of the motion.
    """
    at, index = before.hypothesis, event_index(before)
    longer = [at.with_term(one) if index is None else joined(at, index, one) for one in (*told, *shown)]
    begun = [before.estimator.evaluate(one) for one in longer]
    better = [one for one in begun if one.cost < before.cost]  # windows of another cause make it worse
    fits = [trimmed(completed(fit_windows(one, others=own), others=own), others=own) for one in better]
    evidence, best = CRITERIA.evidence, None
    for fitted in (*fits, *begun[: len(told)]):
        if event_index(fitted) is None or fitted.hypothesis.x.size != longer[0].x.size:
            continue
        gain = bic_gain(fitted, before)
        if (
            gain > evidence
            and before.cost - fitted.cost > CRITERIA.material * before.noise_energy
            and is_event(inside_windows(fitted, before))
        ):
            best, evidence = fitted, gain
    return best
