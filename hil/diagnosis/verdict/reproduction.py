"""How well a twin without new terms reproduces recordings: noise, structure, and torque beside the plain model."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Ledger, examine
from hil.diagnosis.reproduced import REPRODUCED
from hil.diagnosis.stages import Judged
from hil.diagnosis.structure_left import DIFFERENCE, left_in_channel, like_noise, structure_left
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.intended_motion import intended_motion
from hil.identification.torque_left import fit_plain, left_by_plain, torque_deviation, torque_missed

_TABLE = "table"
_WANDERS = 25.0  # mean square over its noise up to which an encoder may wander as slowly as the axis moves: five in rms
_MOTION = 0.9  # share of the energy of the velocity below the frequency up to which the axis moves


@dataclass(frozen=True)
class Reproduced:
    """What a twin leaves.

    `worst` and `held_out`: largest mean square of a channel over its noise, in training and on held-out recordings,
    without a second encoder whose remainder is like noise (`like_noise`) and faster than the motion, or small.
    `noisy`: the noise of a measured torque drives the twin. Beside them the strongest structure in words, and the
    torque missed on held-out motion by the twin and by the plain model, over its deviation (rms). None where there is
    nothing held out, or no torque.
    """

    worst: float
    noisy: bool
    held_out: float | None
    structure: str
    torque: tuple[float, float] | None


def reproduction(fit: Fit, held_out: Dataset) -> Ledger:
    """Answers of the rules on a twin without new terms."""
    structure = structure_left(fit, held_out)
    noise = like_noise(fit, structure) & {_TABLE}
    most = math.inf if noise and _faster_than_motion(fit) else _WANDERS
    worst = _worst(fit, noise, most)
    elsewhere = _worst(fit.on(held_out), noise, most) if held_out.runs else None
    words = structure[0].in_words(fit.bench.axis.drive_unit) if structure else ""
    left, plain = torque_missed(fit, held_out), _missed_by_plain(fit, held_out)
    torque = None if left is None or plain is None else (left, plain)
    noisy = not fit.data.observability.exact_input
    return examine(REPRODUCED, Reproduced(worst, noisy, elsewhere, words, torque), CRITERIA)


def _worst(fit: Fit, noise: Collection[str], most: float) -> float:
    """Largest mean square over its noise of the channels whose remainder is more than `noise`, up to `most`; 1 else."""
    ratios = [(name, one) for run in fit.noise_ratios for name, one in run.items()]
    return max((one for name, one in ratios if name not in noise or one > most), default=1.0)


def _faster_than_motion(fit: Fit) -> bool:
    """True if what is left of the second encoder has mostly higher frequencies than the motion: that does not cause it.

    Of a slower remainder too few values are independent to tell noise from an error that the motion repeats.
    """
    plain = fit_plain(fit.data)
    parts = left_in_channel(fit.hypothesis, fit.data, DIFFERENCE, plain) if plain else []
    slow = total = 0.0
    for run, part in zip(fit.data.runs, parts, strict=False):
        moved = np.cumsum(np.abs(np.fft.rfft(intended_motion(run).velocity)) ** 2)
        left = np.where(part.rows, part.left, 0.0)
        energy = np.abs(np.fft.rfft(left - left[part.rows].mean() * part.rows)) ** 2 if part.rows.any() else np.zeros(1)
        slow += float(energy[: np.searchsorted(moved, _MOTION * moved[-1]) + 1].sum())
        total += float(energy.sum())
    return slow < 0.5 * total


def behind_plain(judged: Judged) -> bool:
    """True if plain least squares predict the torque of held-out motion better than the twin of a verdict."""
    final, held_out = judged.final, judged.tested.searched.prepared.held_out
    left, plain = torque_missed(final, held_out), _missed_by_plain(final, held_out)
    return left is not None and plain is not None and left - plain > CRITERIA.discrepancy


def with_less_torque(given: Judged, other: Judged) -> Judged:
    """The verdict whose twin misses less torque of the held-out motion; the first where both miss as much.

    Another that leaves the second encoder above its noise, and farther than the first does, is none.
    """
    left, less = (torque_missed(one.final, one.tested.searched.prepared.held_out) for one in (given, other))
    before, after = (
        max((run.get(_TABLE, 0.0) for run in one.final.noise_ratios), default=0.0) for one in (given, other)
    )
    worse = after > max(CRITERIA.floor, CRITERIA.worse * before)
    return other if left is not None and less is not None and less < left and not worse else given


def _missed_by_plain(fit: Fit, held_out: Dataset) -> float | None:
    told = held_out.runs and held_out.observability.torque_measured
    plain = fit_plain(fit.data) if told else None
    return (
        None if plain is None else left_by_plain(plain, held_out, torque_deviation([fit.data, held_out], plain.slowest))
    )
