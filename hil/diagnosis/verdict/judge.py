"""Verdict, confidence of a finding, and mechanisms that the motion cannot show.

The confidence of a finding answers whether this effect is there, not whether everything is explained:

    p = 1 / (1 + exp(-s)),   s = a - b ln(1 + e / (factor - 1)) - c ln+(1 / (factor - 1)) - d ln+(1000 / (1 + margin))

with ln+ = max(ln, 0). factor is the residual energy without the term over that with it, so that 1 / (factor - 1) is the
energy left over that which the term explains, and e ten times the share of what is left that is above the noise floor.
It falls with a small energy gain, more so beside a residual that has structure, and with a close rival.

A mechanism is testable if one of its variants, at a typical strength, changes the residuals r [noise] by more than the
evidence that a finding needs:

    visible = | (1 - P) (r(with) - r(without)) |^2,   P: projection on the derivatives by the nominal parameters
"""

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from hil.diagnosis.result import Verdict
from hil.diagnosis.search.initial_values import axis_facts, judged, observable
from hil.diagnosis.search.next_term import MATERIAL, MOST, NEEDED
from hil.diagnosis.verdict.cross_validation import explained_share
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import against
from hil.identification.noise_floor import FLOOR
from hil.identification.parallel import POOL
from hil.identification.terms import Term
from hil.twin.library import BY_ID, LIBRARY

# Reject findings if the unexplained share > 5 % and share x worst residual (in noise rms) > 0.25, for instance a share
# of 1/20 at 5 times the noise or 1/6 at 1.5. The true mechanism in another form leaves less.
_MUCH, _FAR = 0.05, 0.25
# Largest mean square over noise on held-out recordings of a twin that lacks nothing: errors of fitted parameters may
# leave as much rms there as the noise twice.
_ELSEWHERE = 4.0


def judge(owner: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> Verdict:
    """Give the verdict from the fits with the parameters of the bench file, refitted, and with terms.

    If the terms are rejected, the first two decide. What they reproduce in training must hold on held-out recordings.
    """
    if final.terms:
        left = unexplained_share(nominal, final, held_out)
        above = max(final.on(data).worst_ratio for data in (final.data, held_out) if data.runs)
        # where inputs are open, or nothing is known of the control law, something is left beside any name
        open_inputs = not final.data.observability.closed_loop or any(
            run.noise.coarse for run in (*final.data.runs, *held_out.runs)
        )
        if (
            names_stand(left, above)
            or (open_inputs and left <= MOST)
            or (final.at_floor and (left <= MOST or above <= FLOOR))
        ):
            return Verdict.MISSING_PHYSICS
    wrong = not owner.at_floor and refit_matters(owner, nominal)
    if not nominal.at_floor or (held_out.runs and (nominal if wrong else owner).on(held_out).worst_ratio > _ELSEWHERE):
        return Verdict.UNEXPLAINED
    return Verdict.PARAMETER_ERROR if wrong else Verdict.NO_MISMATCH


def unexplained_share(nominal: Fit, final: Fit, held_out: Dataset) -> float:
    """Share of the energy above the floor that the terms leave, on held-out recordings if there are any."""
    evidence = held_out if held_out.runs else final.data
    return 1.0 - explained_share(nominal.on(evidence), final.on(evidence))


def explains_most(nominal: Fit, final: Fit, held_out: Dataset) -> bool:
    """True if the terms explain most of the mismatch, whatever is left above the noise."""
    return bool(final.terms) and unexplained_share(nominal, final, held_out) <= MOST


def names_stand(left: float, above: float) -> bool:
    """True if findings are accepted.

    `left` is the unexplained share of the energy above the floor, `above` the largest mean square of a channel over its
    noise. False for values that are not a number.
    """
    return left <= MOST and (left <= _MUCH or above <= FLOOR or left * above**0.5 <= _FAR)


def refit_matters(owner: Fit, nominal: Fit) -> bool:
    """True if evidence and a material share of energy support the refitted nominal parameters."""
    paid = nominal.hypothesis.x.size * float(np.log(nominal.rows))
    return against(nominal, owner) - paid > NEEDED and owner.cost - nominal.cost > MATERIAL * nominal.rows


# a, b, c, d. c and d: maximum likelihood on 167 findings of early development cases and 249 later ones (PROOF.md lists
# the seeds), between the two. b and the ten: with them a term that explains nearly all beside a large remainder is
# sure, and one of 5 % is not; on 51 findings of 60 sealed cases (seed 20261208, all right) the log likelihood is -1.25.
OFFSET, LEFT, FACTOR, MARGIN = 4.5, 1.0, 0.8, 0.2
_STRUCTURE = 10.0
# Limits of the arguments. Without a clearly needed term the energy doubles; a gain of 1 % is as weak as none; a rival
# at odds of exp(-500) is refuted whatever the model discrepancy.
_DOUBLED, _LEAST = 1.0, 0.01
_PLENTY = 1000.0


def confidence(left: float, factor: float, margin: float) -> float:
    """Probability that the effect of a finding is there, in [0, 1].

    `left`: largest remaining rms of all channels and recordings in units of noise. `factor`: residual energy without
    the term over that with it. `margin`: evidence against the best rival that is not equivalent (BIC difference).
    """
    if not math.isfinite(left):
        return 0.0
    little = max(math.log(_DOUBLED / max(factor - 1.0, _LEAST)), 0.0)
    close = max(math.log(_PLENTY / (1.0 + min(max(margin, 0.0), _PLENTY))), 0.0)
    unexplained = max(left**2 - FLOOR, 0.0) / max(left**2, FLOOR) / max(factor - 1.0, _LEAST)
    score = OFFSET - LEFT * math.log(1.0 + _STRUCTURE * unexplained) - FACTOR * little - MARGIN * close
    return 1.0 / (1.0 + math.exp(-score))


def not_testable(found: Fit, asked: Collection[str] = tuple(BY_ID), margin: float = 1.0) -> tuple[str, ...]:
    """Ids of the mechanisms in `asked` that the data of a fit cannot show, in the library's order.

    `margin` multiplies the visibility that is needed: more than one for simulated recordings.
    """
    bench, hypothesis = found.bench, found.hypothesis.rebased
    present = {term.effect for term in found.terms} | {entry.effect for entry in bench.mechanisms}
    axis = axis_facts(bench, found.data.runs)
    nuisance, _ = np.linalg.qr(found.jacobian[:, : hypothesis.nominal_count])
    search = replace(found.estimator, fast=True)
    unchanged = search.residuals(hypothesis).vector
    enough = margin * max(NEEDED, MATERIAL * found.rows)

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
        if observable(mechanism, variant, bench) and judged(mechanism.id, found.data.runs)
    ]
    shown = {effect for (effect, _), seen in zip(jobs, POOL.map(lambda job: visible(*job), jobs), strict=True) if seen}
    return tuple(mechanism.id for mechanism in wanted if mechanism.id not in shown)
