"""Size of an encoder's count, from another column with a length or a speed, else a count of a micrometre.

And the unit of an angle, in which its steps are counts of an encoder.
"""

from dataclasses import dataclass, field
from fractions import Fraction
from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.importing.lexicon import lexicon
from hil.importing.unit_choice import ANGULAR_SPEEDS, MATCH, UnitChoice
from hil.importing.usual_values import COUNTS, LEADS_M
from hil.quantities import UNITS
from hil.recording.quantum import count_of, is_decimal

_ASSUMED_PER_M = 1e6
_USUAL = 0.003  # relative deviation from usual counts, or from a usual pair of counts and lead: smoothing, errors

_SCALE = 0.01  # deviation of the count of a linear scale: the errors of a lead are below
_WHOLE = 1e-3  # deviation from usual counts per turn: that of steps of few digits
# Largest denominator of a ratio of two encoders or steppers (4000 counts for 3200 steps are 5/4), and deviation allowed
# from such a fraction. At 1e-3 nearly any ratio would pass, and the rest look like an error of the transmission.
_LARGEST, _FRACTION = 32, 1e-4
_DECIMAL = 1e-3  # deviation of a step from a power of ten: of printed digits it tells nothing


@dataclass(frozen=True)
class CountSize:
    """Keys of the map that give the size of a count, and a note if it is not sure; keys that are asked, with what."""

    entry: dict[str, float]
    note: str = ""
    asked: dict[str, str] = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """rad or m."""
        return "rad" if "counts_per_rev" in self.entry else "m"

    @property
    def per_count(self) -> float:
        """Size of a count in that unit."""
        (counts,) = self.entry.values()
        return (2.0 * pi if self.unit == "rad" else 1.0) / counts


def from_speed(per_unit: float, unit: str) -> CountSize:
    """Size of a count, for counts per second = `per_unit` x a speed in `unit`."""
    si, factor = UNITS[unit]
    per_si = abs(per_unit) / factor
    if si == "m/s":
        return CountSize({"counts_per_m": float(f"{per_si:.6g}")})
    per_rev = 2.0 * pi * per_si
    usual = next((counts for counts in COUNTS if abs(per_rev / counts - 1.0) < _USUAL), float(f"{per_rev:.6g}"))
    return CountSize({"counts_per_rev": usual})


def from_length(column: str, per_unit: float, unit: str, length: str, force: bool) -> CountSize:
    """Size of a count, for counts = `per_unit` x the column `length` in `unit`; `force`: the motor is linear."""
    per_m = abs(per_unit) / UNITS[unit][1]
    fits = [(counts, lead) for lead in LEADS_M for counts in COUNTS if abs(counts / (lead * per_m) - 1.0) < _USUAL]
    if force or not fits:
        return CountSize({"counts_per_m": float(f"{per_m:.8g}")})
    counts, lead = fits[0]
    note = (
        f"{column}: {per_m:.6g} counts per m of {length}; {counts:g} per revolution and a lead of "
        f"{1e3 * lead:g} mm are taken, another pair with the same ratio fits as well"
    )
    return CountSize({"counts_per_rev": counts}, note)


def scale_count(per_m: float) -> float | None:
    """Counts per m of a linear scale, 1, 2 or 5 times a power of ten, within 1 % of the measured ones; else None."""
    power = 10.0 ** np.floor(np.log10(per_m))
    usual = (factor * float(power) for factor in (1.0, 2.0, 5.0, 10.0))
    return next((one for one in usual if abs(per_m / one - 1.0) < _SCALE), None)


def counts_ratio(ratio: float) -> float:
    """Counts of one encoder or stepper for each of another, a fraction of small numbers if it is nearly one."""
    usual = float(Fraction(ratio).limit_denominator(_LARGEST))
    return usual if usual and abs(ratio / usual - 1.0) < _FRACTION else ratio


def angle_count(size: float, unit: str) -> float:
    """Size of a count of an angle encoder by a measured `size` in `unit`.

    That of usual counts per turn, or a size or counts per turn of two digits, if one is near; else the measured one.
    """
    turn = 2.0 * pi / UNITS[unit][1]
    round_ones = (float(f"{size:.1e}"), turn / float(f"{turn / size:.1e}"), *(turn / counts for counts in COUNTS))
    near = [one for one in round_ones if abs(size / one - 1.0) < _FRACTION]
    return min(near, key=lambda one: abs(size / one - 1.0), default=float(f"{size:.6g}"))


def angle_unit(column: str, values: FloatArray, speeds: list[tuple[str, float]]) -> UnitChoice | None:
    """Unit of an angle (n,) that has none, by its speeds or by whole counts per turn; None if neither tells it.

    `speeds` are the names of speeds without a unit, and the derivative of the angle over them.
    """
    for name, ratio in speeds:
        size = {(one, per): UNITS[per][1] / UNITS[one][1] for one in ("rad", "deg", "rev") for per in ANGULAR_SPEEDS}
        pairs = [pair for pair, factor in size.items() if abs(abs(ratio) / factor - 1.0) < MATCH]
        if len(pairs) == 1:
            return UnitChoice(pairs[0][0], f"{column} in {pairs[0][0]}, {name} in {pairs[0][1]}: by their ratio")
        if pairs and any(name.lower().startswith(word) for word in lexicon().angular_speed):
            return UnitChoice("rad", f"{column}: rad, because its derivative is {name}, which is usual in rad/s")
    step = count_of(values)
    if step is not None and not is_decimal(step, _DECIMAL):
        for unit in ("rad", "deg", "rev"):
            per_rev = 2.0 * pi / UNITS[unit][1] / step
            if any(abs(per_rev / counts - 1.0) < _WHOLE for counts in COUNTS):
                return UnitChoice(unit, f"{column}: {unit}, because its steps are then {per_rev:.6g} counts per turn")
    return None


def assumed(turns: bool) -> CountSize:
    """Count of unknown size, of a motor that turns or of a linear one; the values mean nothing."""
    what = "is in counts of unknown size; write the counts per"
    if turns:
        return CountSize({"counts_per_rev": COUNTS[0]}, asked={"counts_per_rev": f"{what} revolution of the motor"})
    return CountSize({"counts_per_m": _ASSUMED_PER_M}, asked={"counts_per_m": f"{what} metre, such as 1e6 for 1 um"})
