"""Fit all mechanisms of the library together in the twin; name the significant ones.

    z = strength / standard error,  named where z > 2

It uses the diagnosis's own twin, blocks, fit and periods, and for each mechanism the start with the best score of its
screen, reduced to the share of the residual that it explains. The mechanism without which the residual grows most comes
first; those below the materiality limit are not named.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import POOL, Fit, evaluate, fit
from hil.diagnosis.estimation.terms import Term
from hil.diagnosis.search import successive_halving
from hil.diagnosis.search.forward_selection import MATERIAL
from hil.diagnosis.search.initial_values import Start, starts
from hil.diagnosis.search.score_test import Lead
from hil.identification.dataset import Measured
from hil.proof.peers.case import PeerCase
from hil.twin.library import BY_ID

EVALUATIONS = 12  # a minute on two cores for half a minute of recordings
SIGNIFICANT = 2.0  # standard errors


def fit_everything(case: PeerCase, evaluations: int = EVALUATIONS) -> dict[str, Any]:
    """Return the answer of one fit of everything to a case."""
    begun = {start.effect: start for start in starts(case.scene, case.bench)}
    terms = tuple(_weak(lead, begun[lead.term.effect]) for lead in successive_halving.leads(case.nominal, case.train))
    model = replace(case.nominal.model, terms=terms)
    found = fit(
        model,
        case.train,
        np.concatenate([case.nominal.x, model.initial()[case.nominal.x.size :]]),
        evaluations=evaluations,
    )
    significant = [index for index in range(len(terms)) if _strength_over_error(found, index) > SIGNIFICANT]
    grown = dict(zip(significant, POOL.map(lambda index: _without(found, index, case.train), significant), strict=True))
    named = sorted(
        (index for index in significant if grown[index] > MATERIAL * found.residuals.size),
        key=lambda index: -grown[index],
    )
    return case.answer([terms[index].effect for index in named])


def _weak(lead: Lead, start: Start) -> Term:
    """Return a lead's term with its strength reduced to the share that it explains."""
    values = list(lead.term.values)
    if start.strength >= 0:
        for n in range(start.harmonics):
            values[start.strength + 2 * n] *= max(lead.share, 0.01)
    return replace(lead.term, values=tuple(values))


def _strength_over_error(found: Fit, index: int) -> float:
    """Return the strength of a term in standard errors; the standard error of a logarithm is the relative error.

    Infinite for mechanisms that are not neutral at zero, such as a torque limit: they are judged by the growth of the
    residual alone.
    """
    mechanism = BY_ID[found.model.terms[index].effect]
    if not mechanism.neutral_at_zero:
        return inf
    first = found.model.nominal_count + sum(len(other.values) for other in found.model.terms[:index])
    at = first + mechanism.strength
    error = _standard_errors(found)[at]
    value = 1.0 if found.model.coordinates[at].logarithmic else abs(found.x[at])
    return float(value / max(error, 1e-300))


def _standard_errors(found: Fit) -> FloatArray:
    """Return the standard error of each coordinate for independent rows; infinite if nothing depends on it."""
    normal = found.jacobian.T @ found.jacobian
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    variance = np.diag(np.linalg.pinv(normal / np.outer(size, size), hermitian=True)) * found.reduced
    return np.asarray(np.where(np.diag(normal) > 0.0, np.sqrt(np.maximum(variance, 0.0)) / size, np.inf))


def _without(found: Fit, index: int, runs: Sequence[Measured]) -> float:
    """Return the growth of the sum of squares when a term is removed without a new fit."""
    nominal = found.model.nominal_count
    resolved = found.model.resolved(found.x)[1]
    rest = replace(found.model, terms=tuple(term for k, term in enumerate(resolved) if k != index))
    x = np.concatenate([found.x[:nominal], rest.initial()[nominal:]])
    return evaluate(rest, runs, x).cost - found.cost
