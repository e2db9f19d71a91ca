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

_LIKE, _LIKE_SHARE = 0.01, 0.98  # a set-point is in the unit of the motion, and following errors are below 5 %
_CLEARLY = 10.0  # difference of log likelihoods from which one of two motions answers the torque better


class Computed(NamedTuple):
    """Name of the computed position (a list of one, or empty), and the reason."""

    names: list[str]
    why: str


def computed_one(positions: dict[str, FloatArray], plain: list[str]) -> Computed:
    """Find the set-point among positions (n,); `plain` are those whose names say neither set-point nor encoder.

    It has clearly less noise than the others, or nothing but the rounding of its digits where the others have the
    counts of encoders. A column with such counts is no set-point.
    """
    noises = {name: noise(values) for name, values in positions.items()}
    rounded = {name: _rounding(values, noises[name] * float(np.std(values))) for name, values in positions.items()}
    for name in plain:
        others = [other for other in positions if other != name]
        if rounded[name] == "counts" or not others:
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
