"""Refit of the nominal parameters as it is reported, and the torque that the twins leave on held-out motion."""

from functools import partial

from hil.diagnosis.result import TorqueLeft
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.honest_refit import never_worse, rms_at_floor, rms_of_channels
from hil.identification.torque_left import fit_plain, left_by_plain, left_by_twin


def reported_refit(nominal: Fit) -> Fit:
    """The refit, or the point nearest to it that is in no channel of the training recordings worse than the bench file.

    Channels are compared block by block and, if the control law is known, in closed loop. One at its noise floor is not
    worse.
    """
    return never_worse(nominal, partial(rms_of_channels, data=nominal.data), rms_at_floor(nominal.data))


def torque_left(owner: Fit, nominal: Fit, final: Fit, held_out: Dataset) -> TorqueLeft | None:
    """Shares of the held-out torque that the twins and the plain model leave; None if that cannot be told."""
    if not held_out.runs or any("motor" in run.unseen for run in held_out.runs):
        return None
    plain = fit_plain(nominal.data)
    by_plain = None if plain is None else left_by_plain(plain, held_out)
    if plain is None or by_plain is None:
        return None
    of = {
        name: left_by_twin(fit.hypothesis, held_out, plain.slowest)
        for name, fit in (("owner", owner), ("refitted", nominal), ("final", final))
    }
    return TorqueLeft(plain=by_plain, **of)
