"""Fit all mechanisms of the library together in the twin; name the significant ones.

    z = strength / standard error,  named where z > 2

It uses the diagnosis's own twin, blocks, fit and periods, and for each mechanism the start with the best score of its
screen, reduced to the share of the residual that it explains. The mechanism without which the residual grows most comes
first; those below the materiality limit are not named.
"""

from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.harmonics import is_scaled, pairs
from hil.diagnosis.search.score_test import Candidate, screen_library
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.parallel import POOL
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.validation.proof.peers.case import PeerCase

EVALUATIONS = 12  # a minute on two cores for half a minute of recordings
SIGNIFICANT = 2.0  # standard errors


def fit_everything(case: PeerCase, evaluations: int = EVALUATIONS) -> dict[str, Any]:
    """Return the answer of one fit of everything to a case."""
    terms = tuple(_weak(one) for one in screen_library(case.nominal))
    hypothesis: Hypothesis = reduce(Hypothesis.with_term, terms, case.nominal.hypothesis)
    found = case.nominal.estimator.fit(hypothesis, evaluations=evaluations)
    significant = [
        index
        for index, term in enumerate(terms)
        if not BY_ID[term.effect].neutral_at_zero or _strength_over_error(found, index) > SIGNIFICANT
    ]
    grown = dict(zip(significant, POOL.map(lambda index: _without(found, index), significant), strict=True))
    named = sorted(
        (index for index in significant if grown[index] > CRITERIA.material * found.rows),
        key=lambda index: -grown[index],
    )
    return case.answer([terms[index].effect for index in named])


def _weak(candidate: Candidate) -> Term:
    """Return a candidate's term with its strength reduced to the share that it explains."""
    values = list(candidate.term.values)
    for strength, *_ in pairs(candidate.term) if is_scaled(candidate.term) else ():
        values[strength] *= max(0.01, *candidate.by_channel.values())
    return replace(candidate.term, values=tuple(values))


def _strength_over_error(found: Fit, index: int) -> float:
    """Return the strength of a term in standard errors; the standard error of a logarithm is the relative error."""
    term, hypothesis = found.terms[index], found.hypothesis
    at = hypothesis.columns(index).start + BY_ID[term.effect].strength
    error = _standard_errors(found)[at]
    value = 1.0 if hypothesis.coordinates[at].logarithmic else abs(hypothesis.x[at])
    return float(value / max(error, 1e-300))


def _standard_errors(found: Fit) -> FloatArray:
    """Return the standard error of each coordinate for independent rows; infinite if nothing depends on it."""
    normal = found.jacobian.T @ found.jacobian
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    variance = np.diag(np.linalg.pinv(normal / np.outer(size, size), hermitian=True)) * found.reduced
    return np.asarray(np.where(np.diag(normal) > 0.0, np.sqrt(np.maximum(variance, 0.0)) / size, np.inf))


def _without(found: Fit, index: int) -> float:
    """Return the growth of the sum of squares when a term is removed without a new fit."""
    return found.estimator.evaluate(found.hypothesis.rebased.without(index)).cost - found.cost
