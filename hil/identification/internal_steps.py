"""Internal steps of the twin as fine as the noise of recordings asks.

A recording whose noise hides what longer steps change needs no shorter ones: most of the time of a diagnosis is spent
in them.
"""

from dataclasses import replace

from hil.identification.dataset import SEARCH_STEPS, Dataset
from hil.identification.estimator import Fit
from hil.twin.axis import TWIN_STEPS, Steps

_LONGER = (SEARCH_STEPS, Steps(200e-6, 1e-3))
_UNSEEN = 2.0  # change of all residuals [noise^2]: a tenth of the evidence of a term


def longest_steps(fit: Fit, held_out: Dataset) -> Steps:
    """The longest internal steps that change the residuals of a hypothesis by less than evidence, all together.

    Against those of the twin's own steps, on the recordings of the fit and on held-out ones, as far as there are any.
    """
    found = TWIN_STEPS
    for steps in _LONGER:
        if not all(_change(fit, data, steps) <= _UNSEEN for data in (fit.data, held_out) if data.runs):
            break
        found = steps
    return found


def _change(fit: Fit, data: Dataset, steps: Steps) -> float:
    """Energy of the change of all weighted residuals [noise^2]; NaN where the twin is unstable."""
    own, longer = (
        replace(fit.estimator, data=replace(data, steps=each)).residuals(fit.hypothesis).vector
        for each in (TWIN_STEPS, steps)
    )
    return float((longer - own) @ (longer - own))
