"""Tell a set-point from measured positions: it is computed, and has no noise but the rounding of its digits."""

from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.identification.derivatives import motion
from hil.importing.relations import driven, noise, proportional
from hil.importing.unit_choice import are_counts
from hil.recording.quantum import count_of, is_decimal

QUIET = 0.3  # of the noise of the measured positions: a set-point is computed and has none but rounding
_OF_COUNTS = 0.3  # of the noise that counting gives: less is a step by chance, as of a constant feed
_OF_DIGITS = 2.0  # times the noise that rounding gives: more is a sensor's
_DECIMAL = 1e-3  # relative deviation of a step from a power of ten: noise is in it

# At rest: rows of one value, half of which an axis may take to settle; share of the steps by which a sensor changes.
_RESTING_ROWS, _UNSTEADY = 40, 0.1
_SAME_STEP = 1.5  # times the step of another position: rounding of both

_LIKE, _LIKE_SHARE = 0.01, 0.98  # a set-point is in the unit of the motion, and following errors are below 5 %
_CLEARLY = 10.0  # difference of log likelihoods from which one of two motions answers the torque better


class Computed(NamedTuple):
    """Name of the computed position (a list of one, or empty), and the reason."""

    names: list[str]
    why: str


def computed_one(positions: dict[str, FloatArray], plain: list[str]) -> Computed:
    """Find the set-point among positions (n,); `plain` are those whose names say neither set-point nor encoder.

    It has clearly less noise than the others, or nothing but the rounding of its digits where the others have the
    counts of encoders, or none at rest where the others have some. Else a column with such counts is no set-point.
    """
    noises = {name: noise(values) for name, values in positions.items()}
    rounded = {name: _rounding(values, noises[name] * float(np.std(values))) for name, values in positions.items()}
    for name in plain:
        others = [other for other in positions if other != name]
        if not others:
            continue
        if all(_stands_still(positions[name], positions[other]) for other in others):
            return Computed([name], f"it stands still where {' and '.join(others)} of no finer step does not")
        if rounded[name] == "counts":
            continue
        if noises[name] < QUIET * min(noises[other] for other in others):
            return Computed([name], f"it has less noise than {others[-1]}")
        if rounded[name] == "digits" and all(rounded[other] == "counts" for other in others):
            return Computed([name], f"it is rounded to digits, {' and '.join(others)} to counts of an encoder")
    return Computed([], "")


def unanswered_one(two: dict[str, FloatArray], efforts: list[FloatArray], period_s: float) -> Computed:
    """Find the set-point among two like positions (n,): inertia and friction of it explain the torque clearly worse.

    The torque answers the motion that it makes, a set-point comes before it.
    """
    (first, one), (second, other) = two.items()
    relation = proportional(one, other)
    if not efforts or relation.share < _LIKE_SHARE or abs(relation.factor - 1.0) > _LIKE:
        return Computed([], "")
    moved = {name: motion(values, period_s) for name, values in two.items()}
    left = {name: min(1.0 - driven(effort, moved[name], period_s).share for effort in efforts) for name in two}
    worse, better = (first, second) if left[first] > left[second] else (second, first)
    gain = 0.5 * one.size * float(np.log(left[worse] / max(left[better], 1e-12)))
    why = f"inertia and friction of {better} explain the torque better"
    return Computed([worse], why) if gain > _CLEARLY else Computed([], "")


def _stands_still(computed: FloatArray, measured: FloatArray) -> bool:
    """True if a position (n,) stays at one value at rest, where another one (n,), in steps of no less, does not."""
    changes = np.flatnonzero(np.diff(computed))
    ends = np.r_[changes, computed.size - 1]
    begins = np.r_[0, changes + 1]
    settled = [slice((a + b) // 2, b + 1) for a, b in zip(begins, ends, strict=True) if b - a > _RESTING_ROWS]
    steps = np.concatenate([np.zeros(0), *(np.diff(measured[part]) for part in settled)])
    step, other = count_of(computed), count_of(measured)
    factor = abs(proportional(measured, computed).factor)
    as_fine = step is None or (other is not None and step * factor < _SAME_STEP * other)
    return as_fine and steps.size > _RESTING_ROWS and float(np.mean(steps != 0.0)) > _UNSTEADY


def _rounding(values: FloatArray, noise_abs: float) -> str:
    """Source of the noise of a column: "counts" of an encoder, rounding to decimal "digits", or neither ("")."""
    if are_counts(values):
        return "counts"
    step = count_of(values)
    if step is None:
        return ""
    if is_decimal(step, _DECIMAL):
        return "digits" if noise_abs < _OF_DIGITS * step / np.sqrt(12.0) else ""
    return "counts" if noise_abs > _OF_COUNTS * step / np.sqrt(12.0) else ""
