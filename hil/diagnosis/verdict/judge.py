"""Verdict on plant and control law, from the fits at the bench file's values, refitted, and with terms."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.acceptance import EXPLAINED
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Ledger, accepted, examine
from hil.diagnosis.moment_of_change import MomentOfChange, SteadyChange
from hil.diagnosis.questions import LATENESS
from hil.diagnosis.result import Verdict
from hil.diagnosis.stages import Judged, Tested
from hil.diagnosis.structure_left import Dependence, like_noise, structure_left
from hil.diagnosis.verdict.corrections import corrections, diagnosed_bench
from hil.diagnosis.verdict.each_alone import Change, changed
from hil.diagnosis.verdict.reproduction import reproduction
from hil.diagnosis.verdict.unnamed import unnamed_terms
from hil.identification.coordinates import DELAY
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import bic_gain
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import is_load
from hil.identification.torque_left import fit_plain, left_by_twin, mismatch_left, needed_torque
from hil.twin.library import BY_ID
from hil.twin.mechanism import Block


@dataclass(frozen=True)
class Remainder:
    """What all terms together leave: `left` is the share of the energy above the floor.

    `told` is the share without the channels whose remainder is like noise (`like_noise`), `above` the largest mean
    square of the others over their noise. `open_inputs`: inputs of the twin are open or nothing is known of the control
    law, so that something is left beside any name. `at_floor`: the training recordings are explained. `below_noise`:
    they were so without the terms, whose shapes are their evidence, and held-out ones are with them.
    """

    left: float
    told: float
    above: float
    open_inputs: bool
    at_floor: bool
    below_noise: bool


def judge(tested: Tested) -> Judged:
    """Give the verdict; where terms do not explain the mismatch, parameters of the axis may have changed."""
    searched, final, refit = tested.searched, tested.proof.final, tested.refit
    held_out, law = searched.prepared.held_out, searched.prepared.law
    of_plant, change = verdict_on_plant(searched.given, searched.nominal, final, held_out, law.channels), None
    named = of_plant is Verdict.MISSING_PHYSICS
    open_ones = of_plant is Verdict.UNEXPLAINED and not searched.stopped_at
    beside = structure_left(final if named else refit.fit, held_out) if named or open_ones else ()
    alone = structure_left(refit.fit, held_out) if named else ()
    of_clocks = _clocks_need_less((refit.fit, alone), (final, beside), held_out)
    if of_clocks:
        of_plant, named, open_ones, beside = Verdict.UNEXPLAINED, False, not searched.stopped_at, alone
    moves, whole = any(isinstance(one.question.change, MomentOfChange) for one in beside), refit.fit
    if open_ones or (moves and not searched.stopped_at):
        whole = _with_loads(refit.fit, final)
        change = _better(changed(whole, held_out, moves), searched.nominal, final, held_out)
    if change and (_is_drift(change, beside) or (named and not _needs_less_torque(change, final))):
        change = None
    if change and change.explains_all:
        of_plant = Verdict.AXIS_CHANGED
    verdict = law.verdict(of_plant)
    absorbed = of_clocks or change
    is_part = verdict is Verdict.UNEXPLAINED and not absorbed and explains_part(searched.nominal, final, held_out)
    nominal = refit.fit
    if not is_part and of_plant is not Verdict.MISSING_PHYSICS:
        as_given = of_plant is Verdict.NO_MISMATCH and given_stands(searched.given, held_out)
        nominal = searched.given if as_given else nominal
        final = searched.given if as_given else whole if of_plant is Verdict.AXIS_CHANGED else refit.fit
    # a parameter error is located and measured against the parameters of the bench file
    before = searched.given if of_plant is Verdict.PARAMETER_ERROR else nominal
    of_parts = change.parts if change and change.explains_all else ()
    of_each = [one for part in of_parts for one in structure_left(part, part.data.over([]))]
    left = tuple(sorted(of_each, key=lambda one: -one.explained)) if of_parts else structure_left(final, held_out)
    maps = () if change else unnamed_terms(final, left, held_out)
    return Judged(tested, of_plant, verdict, change, is_part, nominal, before, final, left, maps)


def _with_loads(refit: Fit, final: Fit) -> Fit:
    """The refit beside the loads that are found, a weight, a spring or gravity, so that parts tell theirs."""
    loads = [term for term in final.terms if is_load(term) and not term.windows]
    if not loads:
        return refit
    loaded = replace(refit, hypothesis=Hypothesis(refit.bench, tuple(loads)))
    return fit_nominal_parameters(replace(refit.data, bench=diagnosed_bench(refit.bench, loaded)))


def verdict_on_plant(given: Fit, nominal: Fit, final: Fit, held_out: Dataset, of_law: Collection[str] = ()) -> Verdict:
    """Give the verdict on the plant; for the channels `of_law` the control law answers.

    If the terms are rejected, the first two fits decide, by the rules on a twin without new terms.
    """
    if final.terms and accepted(explanation(nominal, final, held_out, of_law)):
        return Verdict.MISSING_PHYSICS
    matters = refit_matters(given, nominal)
    if given_stands(given, held_out):
        return Verdict.NO_MISMATCH
    if accepted(reproduction(nominal, held_out)):
        return Verdict.PARAMETER_ERROR if matters else Verdict.NO_MISMATCH
    return Verdict.UNEXPLAINED


def given_stands(given: Fit, held_out: Dataset) -> bool:
    """True if the bench file as it is reproduces the recordings."""
    return (given.at_floor or given.within_noise) and accepted(reproduction(given, held_out))


def explanation(nominal: Fit, final: Fit, held_out: Dataset, of_law: Collection[str] = ()) -> Ledger:
    """Answer of the rule on all terms together; without a term of the controller the channels `of_law` do not count."""
    of_plant = all(BY_ID[term.effect].block is not Block.CONTROLLER for term in final.terms)
    other = frozenset(of_law if of_plant else ())
    coarse = any(run.noise.coarse for run in (*final.data.runs, *held_out.runs))
    noise = like_noise(final, structure_left(final, held_out)) | other
    of_runs = [ratios for data in (final.data, held_out) if data.runs for ratios in final.on(data).noise_ratios]
    measured = Remainder(
        left=unexplained_share(nominal, final, held_out, other),
        told=unexplained_share(nominal, final, held_out, noise),
        above=max((ratio for ratios in of_runs for name, ratio in ratios.items() if name not in noise), default=0.0),
        open_inputs=coarse or not final.data.observability.closed_loop,
        at_floor=final.at_floor,
        below_noise=nominal.within_noise and (not held_out.runs or final.on(held_out).within_noise),
    )
    return examine(EXPLAINED, measured, CRITERIA)


def unexplained_share(nominal: Fit, final: Fit, held_out: Dataset, noise: Collection[str] = ()) -> float:
    """Share of the energy above the floor that the terms leave, on held-out recordings if there are any.

    What is left of the channels `noise` does not count.
    """
    return mismatch_left(nominal, final, held_out if held_out.runs else final.data, noise)


def explains_part(nominal: Fit, final: Fit, held_out: Dataset) -> bool:
    """True if the terms explain a part of the mismatch, whatever is left above the noise."""
    return bool(final.terms) and unexplained_share(nominal, final, held_out) <= 1.0 - CRITERIA.worth


def refit_matters(given: Fit, nominal: Fit) -> bool:
    """True if evidence and a material share of energy support the refitted nominal parameters, and one of them is told
    to be another: an open delay of the torque is no parameter of the axis.
    """
    if not told_apart(nominal):
        return False
    paid = nominal.hypothesis.x.size * float(np.log(nominal.rows))
    enough = bic_gain(nominal, given) - paid > CRITERIA.evidence
    return enough and given.cost - nominal.cost > CRITERIA.material * nominal.noise_energy


def told_apart(nominal: Fit) -> bool:
    """True if a refitted parameter is beyond its standard errors from the bench file, or at the end of its range."""
    if set(nominal.at_bound) - {DELAY} or not nominal.jacobian.size:
        return True
    changed = corrections(nominal.bench, nominal).values()
    return any(abs(one.value - one.nominal) > CRITERIA.sigmas * one.std for one in changed)


def _is_drift(change: Change, beside: Sequence[Dependence]) -> bool:
    """True if a delay alone differs from part to part, and does so as one of two clocks that run apart."""
    return bool(_drifts(beside)) and {one.name for one in change.summary.parameters} == {DELAY}


def _drifts(beside: Sequence[Dependence]) -> list[Dependence]:
    """Those of two clocks that run apart."""
    steady = [(one, one.question.change) for one in beside if isinstance(one.question.change, SteadyChange)]
    return [one for one, change in steady if change.coefficient == LATENESS]


def _clocks_need_less(
    without: tuple[Fit, Sequence[Dependence]], named: tuple[Fit, Sequence[Dependence]], held_out: Dataset
) -> bool:
    """True if clocks that run apart leave less torque of all recordings alone than beside names, which absorb them.

    Of each the fit, and what it leaves that depends on something.
    """
    fit, alone = without
    plain = fit_plain(fit.data) if _drifts(alone) else None
    if plain is None:
        return False
    every, left = held_out.over((*fit.data.runs, *held_out.runs)), list[float]()
    for one, found in (without, named):
        missed = left_by_twin(one.hypothesis, every, plain)
        if missed is None:
            return False
        left.append((1.0 - max((drift.explained for drift in _drifts(found)), default=0.0)) * missed**2)
    return left[0] < left[1]


def _needs_less_torque(change: Change, named: Fit) -> bool:
    """True if parameters of each part leave less torque in the recordings that change than the names do."""
    plain = fit_plain(named.data)
    if plain is None or not change.explains_all:
        return False
    whole = [(named.hypothesis, named.data.over(change.runs))]
    parts = [(part.hypothesis, part.data) for part in change.parts]
    left, less = (
        np.concatenate([one.left[one.rows] for twin, data in twins for one in needed_torque(twin, data, plain)])
        for twins in (whole, parts)
    )
    return bool(np.mean(less**2) < np.mean(left**2))


def _better(change: Change | None, nominal: Fit, final: Fit, held_out: Dataset) -> Change | None:
    """The change of the axis, unless the terms leave less."""
    if change and final.terms and unexplained_share(nominal, final, held_out) < change.left:
        return None
    return change
