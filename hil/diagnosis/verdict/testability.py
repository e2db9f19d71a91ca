"""Mechanisms that a motion cannot show.

A mechanism is testable if one of its variants, at a typical strength, changes the residuals r [noise] by more than the
evidence that a finding needs:

    visible = | (1 - P) (r(with) - r(without)) |^2,   P: projection on the derivatives by the nominal parameters
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.search.initial_values import block_observed, observable
from hil.identification.estimator import Fit
from hil.identification.parallel import POOL
from hil.identification.terms import Term
from hil.twin.library import BY_ID, LIBRARY

_ALL = tuple(mechanism.id for mechanism in LIBRARY)


def not_testable(fit: Fit, asked: Collection[str] = _ALL, margin: float = 1.0) -> tuple[str, ...]:
    """Ids of the mechanisms in `asked` that the data of a fit cannot show, in the library's order.

    `margin` multiplies the visibility that is needed: more than one for simulated recordings.
    """
    bench, hypothesis = fit.bench, fit.hypothesis.rebased
    present = {term.effect for term in fit.terms} | {entry.effect for entry in bench.mechanisms}
    axis = axis_facts(bench, fit.data.runs)
    nuisance, _ = np.linalg.qr(fit.jacobian[:, : hypothesis.nominal_count])
    search = replace(fit.estimator, fast=True)
    unchanged = search.residuals(hypothesis).vector
    enough = margin * max(CRITERIA.evidence, CRITERIA.material * fit.rows)

    def visible(effect: str, variant: int) -> bool:
        changed = hypothesis.with_term(Term(effect, variant, BY_ID[effect].typical_values(axis)))
        change = search.residuals(changed).vector - unchanged
        change -= nuisance @ (nuisance.T @ change)
        return float(change @ change) > enough

    wanted = [
        mechanism
        for mechanism in LIBRARY
        if mechanism.id in asked and mechanism.id not in present and (bench.axis.turns or not mechanism.turning)
    ]
    jobs = [
        (mechanism.id, number)
        for mechanism in wanted
        for number, variant in enumerate(mechanism.variants)
        if observable(mechanism, variant, bench) and block_observed(mechanism.id, fit.data.runs)
    ]
    shown = {effect for (effect, _), seen in zip(jobs, POOL.map(lambda job: visible(*job), jobs), strict=True) if seen}
    return tuple(mechanism.id for mechanism in wanted if mechanism.id not in shown)
