"""Refit of the nominal parameters as it is reported, and the torque that the twins leave on held-out motion."""

import numpy as np

from hil.diagnosis.result import TorqueLeft
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.honest_refit import BLOCK, CLOSED, Refit, never_worse, rms_at_floor, rms_of_channels
from hil.identification.hypothesis import Hypothesis
from hil.identification.torque_left import fit_plain, left_by_plain, left_by_twin, torque_deviation

_TORQUE = "torque left"  # share, see `hil.identification.torque_left`


def reported_refit(nominal: Fit) -> Refit:
    """The refit, or the point nearest to it that is in no channel of the training recordings worse than the bench file.

    Channels are compared block by block and, if the control law is known, in closed loop. One at its noise floor is not
    worse. In closed loop one whose block is at its floor is left out: `fit_table` reports the block, and what is left
    in closed loop is a matter of the control law. The torque that the measured motion needs may not grow above what
    plain least squares leaves: residuals of a motion may fall for a wrong mass.
    """
    data = nominal.data
    plain = fit_plain(data) if data.observability.torque_measured else None
    by_plain = None if plain is None else left_by_plain(plain, data)
    floors = rms_at_floor(data) | ({} if by_plain is None else {_TORQUE: by_plain})

    def figures(hypothesis: Hypothesis) -> dict[str, float]:
        found = rms_of_channels(hypothesis, data)
        at_floor = {name for name in found if name.endswith(BLOCK) and found[name] <= floors[name]}
        told = {name: 0.0 if name.replace(CLOSED, BLOCK) in at_floor else value for name, value in found.items()}
        left = None if plain is None else left_by_twin(hypothesis, data, plain)
        return told if left is None or by_plain is None else told | {_TORQUE: left}

    return never_worse(nominal, figures, floors)


def torque_left(given: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> TorqueLeft | None:
    """Shares of the held-out torque that the twins and the plain model leave; None if that cannot be told."""
    if not held_out.runs or not held_out.observability.torque_measured:
        return None
    plain = fit_plain(nominal.data)
    if plain is None:
        return None
    deviation = torque_deviation((nominal.data, held_out), plain.slowest)
    by_plain = left_by_plain(plain, held_out, deviation)
    if by_plain is None:
        return None
    of = {
        name: left_by_twin(fit.hypothesis, held_out, plain, deviation)
        for name, fit in (("owner", given), ("refitted", nominal), ("final", final))
    }
    told = {name: None if left is None or not np.isfinite(left) else left for name, left in of.items()}
    return TorqueLeft(plain=by_plain, **told)
