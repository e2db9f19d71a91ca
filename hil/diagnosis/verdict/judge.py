"""From fits to a verdict: is there a mismatch, a wrong parameter, missing physics, or something without a name?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.estimation.fit import FLOOR, Fit
from hil.diagnosis.estimation.model_comparison import against
from hil.diagnosis.estimation.noise_ratios import noise_ratios
from hil.diagnosis.result import Verdict
from hil.diagnosis.search.forward_selection import MATERIAL, MOST, NEEDED
from hil.diagnosis.verdict.cross_validation import explained_share
from hil.identification.dataset import Measured

# Names are not believed beside so much that has none: a twentieth of the energy above the floor and more, where that
# share, times how far it stands above the noise of a channel, is more than a quarter: a twentieth at five times the
# noise, a sixth at one and a half. The same law in another form leaves less.
_MUCH, _FAR = 0.05, 0.25


def judge(owner: Fit, nominal: Fit, final: Fit, train: Sequence[Measured], held_out: Sequence[Measured]) -> Verdict:
    """The verdict on the bench's own values, their refit, and the refit with the terms found; where these are not
    believed, on the first two."""
    if final.model.terms:
        left = 1.0 - explained_share(nominal, final, held_out or train)
        above = max(ratio for run in (*train, *held_out) for ratio in noise_ratios(final, run).values())
        if names_stand(left, above) or (final.at_floor and (left <= MOST or above <= FLOOR)):
            return Verdict.MISSING_PHYSICS
    if not all(ratio <= FLOOR for run in train for ratio in noise_ratios(nominal, run).values()):
        return Verdict.UNEXPLAINED
    return Verdict.NO_MISMATCH if owner.at_floor or not refit_matters(owner, nominal) else Verdict.PARAMETER_ERROR


def names_stand(left: float, above: float) -> bool:
    """Whether names stand beside a share `left` of the energy above the floor, where the channel that is furthest from
    its noise has `above` times the noise's energy. Never where one of them is not a number."""
    return left <= MOST and (left <= _MUCH or above <= FLOOR or left * above**0.5 <= _FAR)


def refit_matters(owner: Fit, nominal: Fit) -> bool:
    """Whether refitting the nominal parameters is asked for by the evidence, and by more than a trifle."""
    rows = nominal.residuals.size
    paid = nominal.x.size * float(np.log(rows))
    return against(nominal, owner) - paid > NEEDED and owner.cost - nominal.cost > MATERIAL * rows
