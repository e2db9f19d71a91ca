"""How well a twin without new terms reproduces recordings: noise, structure, and torque beside the plain model."""

from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Ledger, examine
from hil.diagnosis.reproduced import REPRODUCED
from hil.diagnosis.stages import Judged
from hil.diagnosis.structure_left import structure_left
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.torque_left import fit_plain, left_by_plain, left_by_twin
from hil.quantities import digits


@dataclass(frozen=True)
class Reproduced:
    """What a twin leaves: the largest mean square of a channel over its noise in training and on held-out recordings,
    the strongest structure in words, and the mean squares of the torque missed on held-out motion, over its squared
    noise, by the twin and by the plain model. None where there is nothing held out, or no torque."""

    worst: float
    held_out: float | None
    structure: str
    torque: tuple[float, float] | None


def reproduction(fit: Fit, held_out: Dataset) -> Ledger:
    """Answers of the rules on a twin without new terms."""
    elsewhere = fit.on(held_out).worst_ratio if held_out.runs else None
    structure = structure_left(fit, held_out)
    words = structure[0].in_words(fit.bench.axis.drive_unit) if structure else ""
    left, plain = torque_missed(fit, held_out), _missed_by_plain(fit, held_out)
    torque = None if left is None or plain is None else (left, plain)
    return examine(REPRODUCED, Reproduced(fit.worst_ratio, elsewhere, words, torque), CRITERIA)


def behind_plain(judged: Judged) -> bool:
    """True if plain least squares predict the torque of held-out motion better than the twin of a verdict."""
    final, held_out = judged.final, judged.tested.searched.prepared.held_out
    left, plain = torque_missed(final, held_out), _missed_by_plain(final, held_out)
    return left is not None and plain is not None and left - plain > CRITERIA.material


def with_less_torque(given: Judged, other: Judged) -> Judged:
    """The verdict whose twin misses less torque of the held-out motion; the other says in a note that it is one."""
    left, less = (torque_missed(one.final, one.tested.searched.prepared.held_out) for one in (given, other))
    if left is None or less is None or left - less <= CRITERIA.material:
        return given
    prepared = other.tested.searched.prepared
    note = (
        "The recordings do not tell the springs and the split of the masses of the bench: with them the twin leaves "
        f"{digits(left**0.5)} times the noise of the torque on held-out motion, as one inertia "
        f"{digits(less**0.5)} times. The axis was judged as one inertia."
    )
    searched = replace(other.tested.searched, prepared=replace(prepared, notes=(*prepared.notes, note)))
    return replace(other, tested=replace(other.tested, searched=searched))


def torque_missed(fit: Fit, held_out: Dataset) -> float | None:
    """Mean square of the torque that held-out motion needs beyond that of a twin, over its squared noise; None: not
    told. Infinite where the twin does not hold the motion."""
    plain = fit_plain(fit.data) if _told(held_out) else None
    if plain is None:
        return None
    left = left_by_twin(fit.hypothesis, held_out, plain.slowest, _noise(held_out))
    return np.inf if left is None else left**2


def _missed_by_plain(fit: Fit, held_out: Dataset) -> float | None:
    plain = fit_plain(fit.data) if _told(held_out) else None
    left = None if plain is None else left_by_plain(plain, held_out, _noise(held_out))
    return None if left is None else left**2


def _told(data: Dataset) -> bool:
    return bool(data.runs) and data.observability.torque_measured


def _noise(data: Dataset) -> float:
    """Noise of the torque over all runs (rms)."""
    return float(np.sqrt(np.mean([run.noise.torque**2 for run in data.runs])))
