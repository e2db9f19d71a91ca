"""Internal steps of the twin as fine as the noise of recordings asks.

A recording whose noise hides what longer steps change needs no shorter ones: most of the time of a diagnosis is spent
in them.
"""

from dataclasses import replace

from hil.identification.dataset import SEARCH_STEPS
from hil.identification.estimator import Fit
from hil.twin.axis import Steps

_LONGER = (SEARCH_STEPS, Steps(200e-6, 1e-3))
_UNSEEN = 2.0  # change of all residuals [noise^2]: a tenth of the evidence of a term


def longest_steps(fit: Fit) -> Steps:
    """The longest internal steps that change the residuals of a fit by less than evidence, all together."""
    found = fit.data.steps
    for steps in _LONGER:
        there = replace(fit.estimator, data=replace(fit.data, steps=steps)).residuals(fit.hypothesis)
        changed = there.vector - fit.residuals.vector
        if not float(changed @ changed) <= _UNSEEN:
            break
        found = steps
    return found
