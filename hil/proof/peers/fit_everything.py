"""Everything at once: all mechanisms of the library fitted together in the twin, those that differ from nothing named.

    z = strength / standard error,  named where z > 2

It is given the diagnosis's own twin, blocks and fit, and for each mechanism the start that the diagnosis's screen likes
best, weakened to the share of the residual that it explains; what it lacks is the search. The mechanism without which
the residual grows most comes first; one that changes nothing to speak of is not named.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.search.forward_selection import MATERIAL
from hil.diagnosis.search.initial_values import Start, starts
from hil.diagnosis.search.score_test import Candidate, screen_library
from hil.identification.estimator import POOL, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.terms import Term
from hil.proof.peers.case import Answer, Case

EVALUATIONS = 12  # a minute on two cores for half a minute of recordings
SIGNIFICANT = 2.0  # standard errors
# The parameter that says how strong a mechanism is, where its start cannot be scaled and it is not the first.
_STRENGTH = {"structural_mode": 2}
# No value of these is without effect but infinity or that of another parameter: that they change nothing says the same.
_NEVER_ZERO = ("stribeck_friction", "presliding_hysteresis", "torque_saturation")


def fit_everything(case: Case, evaluations: int = EVALUATIONS) -> Answer:
    """The answer of one fit of everything about a case."""
    begun = {start.effect: start for start in starts(case.scene, case.bench)}
    terms = tuple(_weak(one, begun[one.term.effect]) for one in screen_library(case.nominal))
    hypothesis: Hypothesis = reduce(Hypothesis.with_term, terms, case.nominal.hypothesis)
    found = case.nominal.estimator.fit(hypothesis, evaluations=evaluations)
    significant = [
        index
        for index, term in enumerate(terms)
        if term.effect in _NEVER_ZERO or _strength_over_error(found, index, begun) > SIGNIFICANT
    ]
    grown = dict(zip(significant, POOL.map(lambda index: _without(found, index), significant), strict=True))
    named = sorted(
        (index for index in significant if grown[index] > MATERIAL * found.rows),
        key=lambda index: -grown[index],
    )
    return case.answer([terms[index].effect for index in named])


def _weak(candidate: Candidate, start: Start) -> Term:
    """A candidate's term at a strength as small as what it explains."""
    values = list(candidate.term.values)
    if start.strength >= 0:
        for n in range(start.harmonics):
            values[start.strength + 2 * n] *= max(candidate.share, 0.01)
    return replace(candidate.term, values=tuple(values))


def _strength_over_error(found: Fit, index: int, begun: dict[str, Start]) -> float:
    """Strength of a term in standard errors; the logarithm of a value has its relative error."""
    term, hypothesis = found.terms[index], found.hypothesis
    strength = max(begun[term.effect].strength, 0) if term.effect not in _STRENGTH else _STRENGTH[term.effect]
    at = hypothesis.columns(index).start + strength
    error = _standard_errors(found)[at]
    value = 1.0 if hypothesis.coordinates[at].logarithmic else abs(hypothesis.x[at])
    return float(value / max(error, 1e-300))


def _standard_errors(found: Fit) -> FloatArray:
    """Of each coordinate, as if all rows were independent: infinite where nothing depends on it."""
    normal = found.jacobian.T @ found.jacobian
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    variance = np.diag(np.linalg.pinv(normal / np.outer(size, size), hermitian=True)) * found.reduced
    return np.asarray(np.where(np.diag(normal) > 0.0, np.sqrt(np.maximum(variance, 0.0)) / size, np.inf))


def _without(found: Fit, index: int) -> float:
    """By how much the sum of squares grows where a term is taken out of the fit as it stands."""
    return found.estimator.evaluate(found.hypothesis.rebased.without(index)).cost - found.cost
