"""From fits to a verdict: no mismatch, wrong parameters, missing physics, or an unexplained mismatch."""

import numpy as np

from hil.diagnosis.result import Verdict
from hil.diagnosis.search.forward_selection import MATERIAL, MOST, NEEDED
from hil.diagnosis.verdict.cross_validation import explained_share
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.model_comparison import against
from hil.identification.noise_floor import FLOOR

# Reject findings if the unexplained share > 5 % and share x worst residual (in noise rms) > 0.25: a twentieth at five
# times the noise, a sixth at one and a half. The same law in another form leaves less.
_MUCH, _FAR = 0.05, 0.25


def judge(owner: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> Verdict:
    """The verdict on the bench's own parameters, their refit, and the refit with terms.

    Where the terms are rejected, the first two decide.
    """
    if final.terms:
        evidence = held_out if held_out.runs else final.data
        left = 1.0 - explained_share(nominal.on(evidence), final.on(evidence))
        above = max(final.on(data).worst_ratio for data in (final.data, held_out) if data.runs)
        if names_stand(left, above) or (final.at_floor and (left <= MOST or above <= FLOOR)):
            return Verdict.MISSING_PHYSICS
    if not nominal.at_floor:
        return Verdict.UNEXPLAINED
    return Verdict.NO_MISMATCH if owner.at_floor or not refit_matters(owner, nominal) else Verdict.PARAMETER_ERROR


def names_stand(left: float, above: float) -> bool:
    """Whether findings are accepted: `left` is the unexplained share of the energy above the floor, `above` the largest
    mean square of a channel over its noise. False for values that are not a number."""
    return left <= MOST and (left <= _MUCH or above <= FLOOR or left * above**0.5 <= _FAR)


def refit_matters(owner: Fit, nominal: Fit) -> bool:
    """Whether evidence and a material share of energy support the refitted nominal parameters."""
    paid = nominal.hypothesis.x.size * float(np.log(nominal.rows))
    return against(nominal, owner) - paid > NEEDED and owner.cost - nominal.cost > MATERIAL * nominal.rows
