"""From fits to a verdict: is there a mismatch, a wrong parameter, missing physics, or something without a name?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.diagnosis.evidence import against
from hil.diagnosis.explain import MATERIAL, NEEDED
from hil.diagnosis.fit import Fit
from hil.diagnosis.proof import explained_share
from hil.diagnosis.result import Verdict
from hil.measured import Measured

# Terms that explain less than half of what is above the floor on recordings of another motion are a fit, not
# an explanation: more of the mismatch is not understood than is.
MOST = 0.5


def judge(owner: Fit, nominal: Fit, final: Fit, train: Sequence[Measured], held_out: Sequence[Measured]) -> Verdict:
    """The verdict on the bench's own values, their refit, and the refit with the terms found."""
    if final.model.terms:
        if final.at_floor or explained_share(nominal, final, held_out or train) >= MOST:
            return Verdict.MISSING_PHYSICS
        return Verdict.UNEXPLAINED
    if not nominal.at_floor:
        return Verdict.UNEXPLAINED
    return Verdict.NO_MISMATCH if owner.at_floor or not refit_matters(owner, nominal) \
        else Verdict.PARAMETER_ERROR


def refit_matters(owner: Fit, nominal: Fit) -> bool:
    """Whether refitting the nominal parameters is asked for by the evidence, and by more than a trifle."""
    rows = nominal.residuals.size
    paid = nominal.x.size * float(np.log(rows))
    return against(nominal, owner) - paid > NEEDED and owner.cost - nominal.cost > MATERIAL * rows
