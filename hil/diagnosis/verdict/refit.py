"""Refit of the nominal parameters as it is reported: in no channel worse than the bench file, and stable.

Beside it the torque that owner's, refitted and final twin leave on held-out motion, with that of a plain model.
"""

import math

import numpy as np

from hil.diagnosis.result import Mode, TorqueLeft
from hil.diagnosis.verdict.fit_table import channel_names, channel_residuals
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.honest_refit import holds, never_worse
from hil.identification.hypothesis import Hypothesis
from hil.identification.noise_floor import FLOOR, rms
from hil.identification.torque_left import fit_plain, left_by_plain, left_by_twin


def reported_refit(nominal: Fit) -> Fit:
    """The refit, or the point nearest to it that is in no channel of the training recordings worse than the bench file.

    Channels are compared in closed loop, if the control law is known, and block by block. One at its noise floor is
    not worse.
    """
    data, bench = nominal.data, nominal.bench
    modes = (Mode.CLOSED_LOOP, Mode.BLOCKS) if bench.law_known else (Mode.BLOCKS,)
    channels = [name for name in channel_names(bench, data.runs[0]) if name != "command"]

    def figures(hypothesis: Hypothesis) -> dict[str, float]:
        found = {}
        for mode in modes:
            lost = mode is Mode.CLOSED_LOOP and not holds(hypothesis, data)
            residuals = channel_residuals(hypothesis, data, mode)
            for name in channels:
                values = [part[name][run.judged] for part, run in zip(residuals, data.runs, strict=True)]
                found[f"{name} {mode}"] = math.inf if lost else rms(np.concatenate(values))
        return found

    pairs = list(zip(data.runs, data.noise, strict=True))
    floors = {
        name: FLOOR**0.5 * math.hypot(*(rms(scale[name][run.judged]) for run, scale in pairs)) / math.sqrt(len(pairs))
        for name in channels
    }
    return never_worse(nominal, figures, {f"{name} {mode}": floors[name] for name in channels for mode in modes})


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
