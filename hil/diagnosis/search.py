"""The search: refit the nominal parameters, screen the library, race the leads, add, prune.

A race fits every lead a little, keeps the better ones, and fits those on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hil.bench import Bench
from hil.diagnosis import starts as catalogue
from hil.diagnosis.data import Run
from hil.diagnosis.fit import Fit, fit, in_parallel
from hil.diagnosis.model import Model
from hil.diagnosis.screen import Lead, screen

_RACERS = 8           # leads that are fitted
_FINALISTS = 3        # of which are fitted to the end
_SPRINT = 6           # evaluations of a first fit
_LONG = 25            # evaluations of a last fit
_SOFT = 30.0          # residual from which a first fit hears less: far above noise, so that valleys stay convex


def nominal(bench: Bench, runs: Sequence[Run]) -> Fit:
    """Fit of the nominal parameters alone."""
    travel = max(float(np.ptp(run.position_command_m)) for run in runs)
    model = Model(bench, (), travel)
    return fit(model, runs, fit(model, runs, soft=_SOFT, evaluations=8).x, evaluations=10)


def leads(base: Fit, runs: Sequence[Run]) -> list[Lead]:
    """One lead for each mechanism and variant that the hypothesis does not have, best first."""
    fitted, terms = base.model.resolved(base.x)
    errors = [base.model.blocks(base.x, run).get("table", run.table_m) for run in runs]
    points = [start for start in catalogue.starts(catalogue.scene(runs, fitted, errors), base.model.bench)
              if start.effect not in {term.effect for term in terms}]
    best: dict[tuple[str, int], Lead] = {}
    for lead in screen(base, runs, points):
        best.setdefault(lead.term.key, lead)
    return list(best.values())


def race(base: Fit, found: Sequence[Lead], runs: Sequence[Run]) -> list[Fit]:
    """Fits of the base with each of the first leads, best first; only the finalists are converged."""

    def sprint(lead: Lead) -> Fit:
        model = replace(base.model, terms=(*base.model.terms, lead.term))
        x = np.concatenate([base.x, model.initial()[base.x.size:]])
        return fit(model, runs, x, soft=_SOFT, evaluations=_SPRINT)

    def finish(found: Fit) -> Fit:
        return fit(found.model, runs, found.x, evaluations=_LONG)

    sprints = in_parallel([partial(sprint, lead) for lead in found[:_RACERS]])
    ranked = sorted(sprints, key=lambda result: result.cost)
    ranked[:_FINALISTS] = in_parallel([partial(finish, result) for result in ranked[:_FINALISTS]])
    return sorted(ranked, key=lambda result: result.cost)
