"""Size of an encoder's count, from another column with a length or a speed, else a count of a micrometre."""

from dataclasses import dataclass
from math import pi

from hil.importing.usual_values import COUNTS, LEADS_M
from hil.quantities import UNITS

_ASSUMED_PER_M = 1e6  # without any other column: travels of 1e4 to 1e7 counts are then 10 mm to 10 m
_USUAL = 0.003  # relative deviation from usual counts, or from a usual pair of counts and lead: smoothing, errors


@dataclass(frozen=True)
class CountSize:
    """Keys of the map that give the size of a count, and a note if it is not sure."""

    entry: dict[str, float]
    note: str = ""

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


def assumed(column: str) -> CountSize:
    """Count of a micrometre, where nothing gives its size: lengths and masses are then in multiples of it."""
    note = (
        f"{column}: is in counts, and no other column tells their size; 1 um per count is taken: lengths, speeds, "
        "masses and stiffness are in multiples of it, and nothing is told per revolution. In the map correct "
        "counts_per_m of each channel in counts; or, of a rotary encoder, give them counts_per_rev instead, rename "
        "motor_position_m to motor_position_rad and force_n to torque_n_m (N to N m), and add lead_m: 6.283185 (of a "
        "rotary axis without a gear)"
    )
    return CountSize({"counts_per_m": _ASSUMED_PER_M}, note)
