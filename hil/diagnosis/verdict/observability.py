"""Which mechanisms a motion could show at all: the change each would make at a typical strength, in units of noise.

    visible = | (1 - P) (r(with) - r(without)) |^2,   P: projection on what the nominal parameters can explain

A mechanism is not testable where even the most of its variants stays below the evidence that a name takes.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from hil.diagnosis.search.forward_selection import MATERIAL, NEEDED
from hil.diagnosis.search.initial_values import axis_facts
from hil.identification.estimator import POOL, Fit
from hil.identification.terms import Term
from hil.twin.library import BY_ID, LIBRARY


def not_testable(found: Fit, asked: Collection[str] = tuple(BY_ID), margin: float = 1.0) -> tuple[str, ...]:
    """Ids of the mechanisms asked for that the data of a fit cannot show, in the library's order.

    `margin` is how many times as visible as needed: more than one where the recordings are only imagined.
    """
    bench, hypothesis = found.bench, found.hypothesis.rebased
    present = {term.effect for term in found.terms} | {entry.effect for entry in bench.mechanisms}
    axis = axis_facts(bench, found.data.runs)
    nuisance, _ = np.linalg.qr(found.jacobian[:, : hypothesis.nominal_count])
    enough = margin * max(NEEDED, MATERIAL * found.rows)

    def visible(effect: str, variant: int) -> bool:
        changed = hypothesis.with_term(Term(effect, variant, BY_ID[effect].typical_values(axis)))
        change = found.estimator.residuals(changed).vector - found.residuals.vector
        change -= nuisance @ (nuisance.T @ change)
        return float(change @ change) > enough

    wanted = [mechanism for mechanism in LIBRARY if mechanism.id in asked and mechanism.id not in present]
    jobs = [
        (mechanism.id, variant)
        for mechanism in wanted
        for variant in range(len(mechanism.variants))
        if bench.has_table_encoder or not mechanism.needs_table
    ]
    shown = {effect for (effect, _), seen in zip(jobs, POOL.map(lambda job: visible(*job), jobs), strict=True) if seen}
    return tuple(mechanism.id for mechanism in wanted if mechanism.id not in shown)
