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
from hil.diagnosis.fit import Fit, fit, in_parallel
from hil.diagnosis.model import (
    LAST_EDGE_STEP_S,
    SEARCH_ACCURACY,
    TORQUE_ACCURACY,
    Model,
    observer_time_s,
)
from hil.diagnosis.screen import Lead, screen
from hil.measured import Measured

_RACERS = 8           # leads that are fitted
_FINALISTS = 3        # of which are fitted to the end
_SPRINT = 6           # evaluations of a first fit
_LONG = 25            # evaluations of a last fit
_HOPELESS = 0.02      # a lead that explains this little of what the first explains is not fitted
_SOFT = 30.0          # residual from which a first fit hears less: far above noise, so that valleys stay convex


def nominal(bench: Bench, runs: Sequence[Measured]) -> Fit:
    """Fit of the nominal parameters alone."""
    travel = max(float(np.ptp(run.position_command_m)) for run in runs)
    model = Model(bench, (), travel, observer_time_s(runs, bench))
    return fit(model, runs, fit(model, runs, soft=_SOFT, evaluations=8).x, evaluations=10)


def leads(base: Fit, runs: Sequence[Measured]) -> list[Lead]:
    """One lead for each mechanism and variant that the hypothesis does not have, best first."""
    fitted, terms = base.model.resolved(base.x)
    blocks = [base.model.blocks(base.x, run) for run in runs]
    scene = catalogue.scene(runs, fitted, blocks, base.model.observer_s)
    points = [start for start in catalogue.starts(scene, base.model.bench)
              if start.effect not in {term.effect for term in terms}]
    best: dict[tuple[str, int], Lead] = {}
    for lead in screen(base, runs, points):
        best.setdefault(lead.term.key, lead)
    return list(best.values())


def race(base: Fit, found: Sequence[Lead], runs: Sequence[Measured]) -> list[Fit]:
    """Fits of the base with each of the first leads, best first; only the finalists are converged."""

    def sprint(lead: Lead) -> Fit:
        model = replace(base.model, terms=(*base.model.terms, lead.term), torque_accuracy=SEARCH_ACCURACY)
        x = np.concatenate([base.x, model.initial()[base.x.size:]])
        return fit(model, runs, x, soft=_SOFT, evaluations=_SPRINT)

    def afresh(found: Fit) -> Fit:
        """From the owner's nominal values: the base may have bent its own to make up for what it lacks."""
        x = found.x.copy()
        count = found.model.nominal_count
        x[:count] = found.model.initial()[:count]
        return finish(fit(found.model, runs, x, soft=_SOFT, evaluations=_SPRINT))

    def finish(found: Fit) -> Fit:
        if any("end_s" in coordinate.name for coordinate in found.model.coordinates):
            found = fit(found.model, runs, found.x, evaluations=_LONG)
        found = fit(replace(found.model, edge_step_s=LAST_EDGE_STEP_S), runs, found.x, evaluations=_LONG)
        return fit(replace(found.model, torque_accuracy=TORQUE_ACCURACY), runs, found.x, evaluations=_SPRINT)

    good = [lead for lead in found[:_RACERS] if lead.share > _HOPELESS * found[0].share]
    sprints = in_parallel([partial(sprint, lead) for lead in good])
    ranked = sorted(sprints, key=lambda result: result.cost)
    # those that got furthest, and the first by the screen, which may only have had a slow start
    finalists = list({id(result): result for result in (*ranked[:_FINALISTS], *sprints[:2])}.values())
    jobs = [partial(finish, result) for result in finalists] + [partial(afresh, result) for result in ranked[:1]]
    best: dict[tuple[str, int], Fit] = {}
    for result in in_parallel(jobs):
        key = result.model.terms[-1].key
        if key not in best or result.cost < best[key].cost:
            best[key] = result
    return sorted(best.values(), key=lambda result: result.cost)
