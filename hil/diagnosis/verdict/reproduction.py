"""How well a twin without new terms reproduces recordings: noise, structure, and torque beside the plain model."""

from collections.abc import Collection
from dataclasses import dataclass

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Ledger, examine
from hil.diagnosis.reproduced import REPRODUCED
from hil.diagnosis.stages import Judged
from hil.diagnosis.structure_left import like_noise, structure_left
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.torque_left import fit_plain, left_by_plain, torque_deviation, torque_missed

_TABLE = "table"
_WANDERS = 25.0  # mean square over its noise up to which an encoder may wander: five times in rms


@dataclass(frozen=True)
class Reproduced:
    """What a twin leaves.

    `worst` and `held_out`: largest mean square of a channel over its noise, in training and on held-out recordings,
    without a second encoder whose remainder is like noise (`like_noise`): encoders wander by some times their noise.
    `noisy`: the noise of a measured torque drives the twin. Beside them the strongest structure in words, and the torque missed on held-out
    motion by the twin and by the plain model, over its deviation (rms). None where there is nothing held out, or no
    torque.
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
    worst = _worst(fit, noise)
    elsewhere = _worst(fit.on(held_out), noise) if held_out.runs else None
    words = structure[0].in_words(fit.bench.axis.drive_unit) if structure else ""
    left, plain = torque_missed(fit, held_out), _missed_by_plain(fit, held_out)
    torque = None if left is None or plain is None else (left, plain)
    noisy = not fit.data.observability.exact_input
    return examine(REPRODUCED, Reproduced(worst, noisy, elsewhere, words, torque), CRITERIA)


def _worst(fit: Fit, noise: Collection[str]) -> float:
    """Largest mean square over its noise of the channels whose remainder is more than `noise`; 1 without any."""
    ratios = [(name, one) for run in fit.noise_ratios for name, one in run.items()]
    return max((one for name, one in ratios if name not in noise or one > _WANDERS), default=1.0)


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
