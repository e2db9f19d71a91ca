"""The search: refit the nominal parameters, screen the library, race the leads, add, prune.

A race fits every lead a little, keeps the better ones, and fits those on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.estimation.fit import POOL, Fit, evaluate, fit, in_parallel, jacobian, soft_cost
from hil.diagnosis.estimation.hypothesis import (
    LAST_EDGE_STEP_S,
    SEARCH_ACCURACY,
    TORQUE_ACCURACY,
    TRUST,
    Model,
    inertia,
    observer_time_s,
)
from hil.diagnosis.estimation.terms import Term, compatible, free_slot, repeats
from hil.diagnosis.search import initial_values as catalogue
from hil.diagnosis.search.equivalents import likenesses
from hil.diagnosis.search.initial_values import Start
from hil.diagnosis.search.score_test import Lead, screen
from hil.identification.dataset import Measured
from hil.twin.library import BY_ID
from hil.twin.mechanism import Role

_RACERS = 8  # leads that are fitted
_SPRINTERS = 4  # of which are fitted on
_FINALISTS = 3  # of which are fitted to the end
_OTHERS = 6  # starts of one mechanism that are weighed
_NEAR = 6  # evaluations of a first fit with the derivatives of the base
_SPRINT = 4  # and of the one after it
LONG = 25  # evaluations of a last fit
_BEATEN = 5.0  # times the energy that the leader leaves: a sprint that leaves more is not converged,
_LEVEL = 1.5  # except where it is level with the leader, as far as that had come by then;
_BEHIND = 0.5  # nor one that takes away less than this share of what the leader does
_HOPELESS = 0.02  # a lead that explains this little of what the first explains is not fitted
_EDGE_SHIFTS_S = np.arange(-15, 16) * 0.005  # of an edge, where it may have been missed
SOFT = 30.0  # residual from which a first fit hears less: far above noise, so that valleys stay convex


def nominal(bench: Bench, runs: Sequence[Measured]) -> Fit:
    """Fit of the nominal parameters alone."""
    travel = max(float(np.ptp(run.position_command_m)) for run in runs)
    model = Model(bench, (), travel, observer_time_s(runs, bench))
    return fit(model, runs, fit(model, runs, soft=SOFT, evaluations=8).x, evaluations=10)


def leads(base: Fit, runs: Sequence[Measured]) -> list[Lead]:
    """One lead for each mechanism that the hypothesis may have beside its terms, the most promising one, best first."""
    fitted, terms = base.model.resolved(base.x)
    blocks = [base.model.blocks(base.x, run) for run in runs]
    scene = catalogue.scene(runs, fitted, blocks, base.model.observer_s)
    points = [
        _from_known(start, base.model)
        for start in catalogue.starts(scene, base.model.bench)
        if offered(Term(start.effect, start.variant, start.values), base.model, terms)
    ]
    best: dict[str, list[Lead]] = {}
    for lead in screen(base, runs, points):
        best.setdefault(lead.term.effect, []).append(lead)

    def gathered(effect: str, same: Sequence[Lead]) -> Lead:
        slot = free_slot(effect, terms)
        first, *rest = (
            replace(term, slot=slot)
            for term in (same[0].term, *same[0].others, *(lead.term for lead in same[1:_OTHERS]))
        )
        return Lead(first, same[0].share, tuple(rest))

    return [gathered(effect, same) for effect, same in best.items()]


def offered(new: Term, model: Model, terms: Sequence[Term]) -> bool:
    """Whether there is room for one more beside the terms; what it says again of the bench's mechanisms gives way."""
    known = [entry.active() for entry in model.kept]
    return compatible((*terms, new, *(other for other in known if not repeats(new, other))))


def _from_known(start: Start, model: Model) -> Start:
    """The start, counted from the strength of that mechanism of the bench whose place it takes, where it can be."""
    new = Term(start.effect, start.variant, start.values)
    taken = [entry.active() for entry in model.kept if repeats(new, entry.active())]
    if start.strength < 0 or not taken:
        return start
    if start.phase >= 0 or taken[0].variant != start.variant:
        return replace(start, instead=True)
    return replace(start, known=taken[0].values[start.strength])


def race(base: Fit, found: Sequence[Lead], runs: Sequence[Measured]) -> list[Fit]:
    """Fits of the base with each of the first leads, best first.

    All start; the one that gets furthest is converged, in all its variants. Others are, too, if they are anywhere near
    it; how far exactly those are that lost is nobody's question.
    """
    searched = replace(base.model, torque_accuracy=SEARCH_ACCURACY)
    trusted = believed(base)
    known = {tuple(x): jacobian(searched, x, searched.residuals(x, runs), runs) for x in (base.x, *trusted)}

    def near(lead: Lead) -> Fit:
        """A first fit, with the derivatives of the base or at the owner's values.

        Of the first leads the variant that the screen prefers starts too: another may do so little that it is likelier.
        """
        begun = [likeliest(lead, base.x)]
        if lead in good[:_SPRINTERS]:
            begun.append(owners(lead))
            if begun[0].model.terms[-1].variant != lead.term.variant:
                begun.append(
                    likeliest(
                        replace(lead, others=tuple(term for term in lead.others if term.variant == lead.term.variant)),
                        base.x,
                    )
                )
        found = [
            fit(first.model, runs, first.x, soft=SOFT, evaluations=_NEAR, held=known[tuple(first.x[: base.x.size])])
            for first in begun
        ]
        return min(found, key=lambda result: soft_cost(result.residuals, SOFT))

    def owners(lead: Lead) -> Fit:
        """The likeliest point of a lead at values of the owner."""
        return min((likeliest(lead, x) for x in trusted), key=lambda found: soft_cost(found.residuals, SOFT))

    def likeliest(lead: Lead, x: FloatArray) -> Fit:
        """The point of a lead that leaves least beside what is known at `x`."""
        models = [replace(searched, terms=(*base.model.terms, term)) for term in (lead.term, *lead.others)]
        begun = [evaluate(model, runs, np.concatenate([x, model.initial()[x.size :]])) for model in models]
        return min(begun, key=lambda found: soft_cost(found.residuals, SOFT))

    def sprint(found: Fit) -> Fit:
        return fit(found.model, runs, found.x, soft=SOFT, evaluations=_SPRINT, slopes=found.jacobian)

    def afresh(found: Fit) -> Fit:
        """From the owner's values, with derivatives of its own."""
        lead = next(lead for lead in good if lead.term.effect == found.model.terms[-1].effect)
        first = owners(lead)
        again = fit(first.model, runs, first.x, soft=SOFT, evaluations=_SPRINT)
        return finish(again) if gained(again) > 0.0 else again

    def finish(found: Fit) -> Fit:
        if any(coordinate.role is Role.EDGE for coordinate in found.model.coordinates):
            found = fit(found.model, runs, found.x, evaluations=LONG, slopes=found.jacobian)
            found = _edges_moved(found, runs)
        found = fit(
            replace(found.model, edge_step_s=LAST_EDGE_STEP_S), runs, found.x, evaluations=LONG, slopes=found.jacobian
        )
        return fit(replace(found.model, torque_accuracy=TORQUE_ACCURACY), runs, found.x, evaluations=_SPRINT)

    def variants(found: Fit) -> list[Fit]:
        """The other variants of the last term, from where this one ended."""
        *rest, last = found.model.resolved(found.x)[1]
        others = [
            replace(found.model, terms=(*rest, replace(last, variant=variant)))
            for variant in range(len(BY_ID[last.effect].variants))
            if variant != last.variant
        ]
        return in_parallel(
            [
                partial(
                    fit,
                    model,
                    runs,
                    np.concatenate([found.x[: model.nominal_count], model.initial()[model.nominal_count :]]),
                )
                for model in others
            ]
        )

    def likes(found: Fit) -> list[Fit]:
        """What the last term may pass for, from where it ended."""
        bench, terms = found.model.resolved(found.x)
        others = []
        for alike in likenesses(terms, bench):
            if not offered(alike[0], base.model, terms[:-1]):
                continue
            models = [replace(found.model, terms=(*terms[:-1], term)) for term in alike]
            begun = in_parallel(
                [
                    partial(
                        evaluate,
                        model,
                        runs,
                        np.concatenate([found.x[: model.nominal_count], model.initial()[model.nominal_count :]]),
                    )
                    for model in models
                ]
            )
            nearest = min(begun, key=lambda other: other.cost)
            others.append(partial(fit, nearest.model, runs, nearest.x))
        return in_parallel(others)

    def gained(found: Fit) -> float:
        return base.cost - found.cost

    good = [lead for lead in found[:_RACERS] if lead.share > _HOPELESS * found[0].share]
    started = in_parallel([partial(near, lead) for lead in good])
    # those that got furthest, and the first by the screen, which may only have had a slow start
    better = sorted(started, key=lambda result: result.cost)[:_SPRINTERS]
    sprints = in_parallel([partial(sprint, result) for result in unique([*started[:2], *better])])
    ranked = sorted(sprints, key=lambda result: result.cost)
    leader = finish(ranked[0])
    others = [result for result in unique([*sprints[:2], *ranked[:_FINALISTS]]) if result is not ranked[0]]
    level, *reached = [
        evaluate(replace(result.model, torque_accuracy=TORQUE_ACCURACY), runs, result.x)
        for result in (ranked[0], *others)
    ]
    beaten = max(_BEATEN * leader.cost, _LEVEL * level.cost)
    again = [] if leader.at_floor else [partial(afresh, ranked[0])]
    results = [
        leader,
        *reached,
        *in_parallel(
            again
            + [
                partial(finish, other)
                for other, result in zip(others, reached, strict=True)
                if result.cost < beaten and gained(result) > _BEHIND * gained(leader)
            ]
        ),
    ]
    best_yet = min(results, key=lambda result: result.cost)
    results += [*variants(best_yet), *likes(best_yet)]
    best: dict[str, Fit] = {}
    for result in results:
        effect = result.model.terms[-1].effect
        if not compatible(result.model.resolved(result.x)[1]):
            continue
        if effect not in best or result.cost < best[effect].cost:
            best[effect] = result
    return sorted(best.values(), key=lambda result: result.cost)


def believed(base: Fit) -> list[FloatArray]:
    """The vector of a base with the owner's values, of all nominal parameters, and of those that a rigid body hides.

    The base may have bent its values to make up for what it lacks. What lies between motor and table bends the springs
    and the shares of the masses, and leaves friction and their sum as right as they are.
    """
    bench, count = base.model.bench, base.model.nominal_count
    owner = np.concatenate([base.model.initial()[:count], base.x[count:]])
    if not bench.axis.SPRINGS:
        return [owner]
    axis, coordinates = bench.axis, base.model.coordinates

    def heavier(factor: float) -> Bench:
        return bench.model_copy(
            update={"axis": axis.model_copy(update={name: factor * getattr(axis, name) for name in axis.MASSES})}
        )

    light, heavy, wanted = inertia(bench), inertia(heavier(2.0)), inertia(base.model.resolved(base.x)[0])
    factor = max(1.0 + (wanted - light) / (heavy - light), 1.0 / TRUST)
    hidden = base.x.copy()
    for index, coordinate in enumerate(coordinates[:count]):
        if coordinate.name in axis.MASSES:
            hidden[index] = coordinate.x(factor * getattr(axis, coordinate.name))
        elif coordinate.name in axis.SPRINGS:
            hidden[index] = owner[index]
    return [owner, hidden]


def _edges_moved(found: Fit, runs: Sequence[Measured]) -> Fit:
    """A fit with each edge of a window where it leaves least: their valleys are narrow, a step leads past them."""
    x, low, high = found.x.copy(), *found.model.bounds()
    for index, coordinate in enumerate(found.model.coordinates):
        if coordinate.role is not Role.EDGE:
            continue
        edges = np.tile(x, (_EDGE_SHIFTS_S.size, 1))
        edges[:, index] = [coordinate.x(coordinate.value(x[index]) + shift_s) for shift_s in _EDGE_SHIFTS_S]
        edges = np.clip(edges, low, high)
        x = min(POOL.map(partial(evaluate, found.model, runs), edges), key=lambda other: other.cost).x
    return fit(found.model, runs, x, evaluations=LONG)


def unique(fits: Sequence[Fit]) -> list[Fit]:
    """Each fit once, in order."""
    return list({id(found): found for found in fits}.values())
