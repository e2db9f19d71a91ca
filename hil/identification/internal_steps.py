"""Internal steps of the twin as fine as the noise of recordings asks.

A recording whose noise hides what longer steps change needs no shorter ones: most of the time of a diagnosis is spent
in them.
"""

from dataclasses import replace

from hil.arrays import FloatArray
from hil.identification.dataset import SEARCH_STEPS, Dataset
from hil.identification.estimator import Fit
from hil.twin.axis import TWIN_STEPS, Steps

_LONGER = (SEARCH_STEPS, Steps(200e-6, 1e-3))
_UNSEEN = 2.0  # change of all residuals [noise^2]: a tenth of the evidence of a term


def longest_steps(fit: Fit, held_out: Dataset) -> Steps:
    """The longest internal steps that change the residuals of a hypothesis by less than evidence, all together.

    Against those of the twin's own steps, on the recordings of the fit and on held-out ones, as far as there are any.
    """
    found, own = TWIN_STEPS, [(data, _left(fit, data, TWIN_STEPS)) for data in (fit.data, held_out) if data.runs]
    for steps in _LONGER:
        changes = (_left(fit, data, steps) - left for data, left in own)
        if not all(float(change @ change) <= _UNSEEN for change in changes):  # NaN where the twin is unstable
            break
        found = steps
    return found


def _left(fit: Fit, data: Dataset, steps: Steps) -> FloatArray:
    """Weighted residuals (m,) of the hypothesis of a fit on recordings with other steps."""
    return replace(fit.estimator, data=replace(data, steps=steps)).residuals(fit.hypothesis).vector
