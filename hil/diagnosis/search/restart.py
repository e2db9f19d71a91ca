"""What a refit hides by bending parameters, searched from the owner's.

A screen takes out of what is left, and of what a mechanism would do, all that parameters could explain if they were
free to go anywhere. That is much more than they can: 94 % of what a spring did that pulls a table, 47 times the noise,
where the refit explained a tenth. Where nothing more is found and most of the mismatch is left, the library is
screened again beside the values that the owner believes, with nothing taken out.

A nut without preload is softer while it stays in its gap. Where other springs lie beside it, a refit bends these and
their damping until little is left, and there a score test, which sees small changes only, finds no way back. So
the mechanism is fitted from the owner's springs. With one spring alone, softer all the time, it would be that spring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hil.diagnosis.estimation.fit import Fit, evaluate, fit, in_parallel
from hil.diagnosis.estimation.hypothesis import LAST_EDGE_STEP_S, SEARCH_ACCURACY, TORQUE_ACCURACY
from hil.diagnosis.estimation.terms import Term, compatible
from hil.diagnosis.search.initial_values import stretches
from hil.diagnosis.search.successive_halving import LONG, SOFT, believed, leads, race
from hil.diagnosis.search.validity import claimable
from hil.identification.dataset import Measured
from hil.twin.library import LIBRARY

_EFFECT, _STARTS = next((mechanism.id, mechanism.hidden_starts) for mechanism in LIBRARY if mechanism.hidden_starts)
_FIRST = 20  # evaluations of a first fit: far from the base, it has farther to go than a race's
_NARROWEST_M = 1e-6  # gap to begin with where motor and table do not part at all


def from_owner(base: Fit, runs: Sequence[Measured]) -> list[Fit]:
    """Fits of the base with each of the first leads beside what the owner believes, best first."""
    believes = evaluate(base.model, runs, believed(base)[-1])  # no derivatives: nothing is left to parameters
    bench, _ = believes.model.resolved(believes.x)
    promising = [lead for lead in leads(believes, runs) if claimable(lead.term, bench)]
    return race(believes, promising, runs) if promising else []


def may_hide(base: Fit, runs: Sequence[Measured]) -> bool:
    """Whether the axis has several springs, a linear encoder that shows them, and no lost preload yet."""
    bench, terms = base.model.resolved(base.x)
    known = [entry.active() for entry in base.model.kept]
    return (
        len(bench.axis.physics().chain.names) > 2
        and bool(runs[0].table_m.size)
        and compatible((*terms, Term(_EFFECT, 0, _STARTS[0]), *known))
    )


def unbent(base: Fit, runs: Sequence[Measured]) -> Fit:
    """The base with a lost preload, fitted from the owner's springs."""
    widest_m = max(stretches(runs, base.model.bench.axis.ratio_m_rad)[1], _NARROWEST_M)
    x = believed(base)[-1]

    def begun(start: tuple[float, ...]) -> Fit:
        term = Term(_EFFECT, 0, (start[0] * widest_m, *start[1:]))
        model = replace(base.model, terms=(*base.model.terms, term), torque_accuracy=SEARCH_ACCURACY)
        return fit(model, runs, np.concatenate([x, model.initial()[x.size :]]), soft=SOFT, evaluations=_FIRST)

    best = min(in_parallel([partial(begun, start) for start in _STARTS]), key=lambda found: found.cost)
    return fit(
        replace(best.model, torque_accuracy=TORQUE_ACCURACY, edge_step_s=LAST_EDGE_STEP_S),
        runs,
        best.x,
        evaluations=LONG,
    )
