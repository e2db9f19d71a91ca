"""A hypothesis on other recordings of its axis: refitted, or carried over with its values."""

import math
from dataclasses import replace

from hil.diagnosis.search.rivals import ENDED
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.plain_model import PlainModel
from hil.identification.torque_left import left_by_twin


def noisy_springs(data: Dataset) -> bool:
    """True for springs driven by a torque with noise: a light motor answers it far above the noise of its encoder."""
    return bool(data.bench.axis.SPRINGS) and data.observability.noisy_torque_input


def less_torque(plain: PlainModel, *fits: Fit) -> Fit:
    """The fit that leaves least of the torque: the noise of its torque may have led a fit astray."""

    def left(fit: Fit) -> float:
        share = left_by_twin(fit.hypothesis, fit.data, plain)
        return math.inf if share is None else share

    return min(fits, key=left)


def over(data: Dataset, fit: Fit) -> Fit:
    """Fit the hypothesis of a fit to another data set."""
    return replace(fit.estimator, data=data).fit(fit.hypothesis, evaluations=ENDED)


def carried(data: Dataset, fit: Fit) -> Fit:
    """A fit with its own values on another data set, with the residuals and the Jacobian there."""
    return replace(replace(fit.estimator, data=data).fit(fit.hypothesis, evaluations=1), converged=fit.converged)
