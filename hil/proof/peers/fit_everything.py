"""Everything at once: all mechanisms of the library fitted together in the twin, those that differ from nothing named.

    z = strength / standard error,  named where z > 2

It is given the diagnosis's own twin, blocks and fit, and for each mechanism the start that the diagnosis's screen likes
best, weakened to the share of the residual that it explains; what it lacks is the search. The mechanism without which
the residual grows most comes first; one that changes nothing to speak of is not named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import POOL, Fit, evaluate, fit
from hil.diagnosis.estimation.terms import Term
from hil.diagnosis.search import successive_halving
from hil.diagnosis.search.forward_selection import MATERIAL
from hil.diagnosis.search.initial_values import Start, starts
from hil.diagnosis.search.score_test import Lead
from hil.identification.dataset import Measured
from hil.proof.peers.case import Answer, Case
from hil.twin.library import BY_ID

EVALUATIONS = 12  # a minute on two cores for half a minute of recordings
SIGNIFICANT = 2.0  # standard errors


def fit_everything(case: Case, evaluations: int = EVALUATIONS) -> Answer:
    """The answer of one fit of everything about a case."""
    begun = {start.effect: start for start in starts(case.scene, case.bench)}
    terms = tuple(_weak(lead, begun[lead.term.effect]) for lead in successive_halving.leads(case.nominal, case.train))
    model = replace(case.nominal.model, terms=terms)
    found = fit(
        model,
        case.train,
        np.concatenate([case.nominal.x, model.initial()[case.nominal.x.size :]]),
        evaluations=evaluations,
    )
    significant = [
        index
        for index, term in enumerate(terms)
        if not BY_ID[term.effect].neutral_at_zero or _strength_over_error(found, index) > SIGNIFICANT
    ]
    grown = dict(zip(significant, POOL.map(lambda index: _without(found, index, case.train), significant), strict=True))
    named = sorted(
        (index for index in significant if grown[index] > MATERIAL * found.residuals.size),
        key=lambda index: -grown[index],
    )
    return case.answer([terms[index].effect for index in named])


def _weak(lead: Lead, start: Start) -> Term:
    """A lead's term at a strength as small as what it explains."""
    values = list(lead.term.values)
    if start.strength >= 0:
        for n in range(start.harmonics):
            values[start.strength + 2 * n] *= max(lead.share, 0.01)
    return replace(lead.term, values=tuple(values))


def _strength_over_error(found: Fit, index: int) -> float:
    """Strength of a term in standard errors; the logarithm of a value has its relative error."""
    term = found.model.terms[index]
    first = found.model.nominal_count + sum(len(other.values) for other in found.model.terms[:index])
    strength = BY_ID[term.effect].strength
    at = first + strength
    error = _standard_errors(found)[at]
    value = 1.0 if found.model.coordinates[at].logarithmic else abs(found.x[at])
    return float(value / max(error, 1e-300))


def _standard_errors(found: Fit) -> FloatArray:
    """Of each coordinate, as if all rows were independent: infinite where nothing depends on it."""
    normal = found.jacobian.T @ found.jacobian
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    variance = np.diag(np.linalg.pinv(normal / np.outer(size, size), hermitian=True)) * found.reduced
    return np.asarray(np.where(np.diag(normal) > 0.0, np.sqrt(np.maximum(variance, 0.0)) / size, np.inf))


def _without(found: Fit, index: int, runs: Sequence[Measured]) -> float:
    """By how much the sum of squares grows where a term is taken out of the fit as it stands."""
    nominal = found.model.nominal_count
    resolved = found.model.resolved(found.x)[1]
    rest = replace(found.model, terms=tuple(term for k, term in enumerate(resolved) if k != index))
    x = np.concatenate([found.x[:nominal], rest.initial()[nominal:]])
    return evaluate(rest, runs, x).cost - found.cost
