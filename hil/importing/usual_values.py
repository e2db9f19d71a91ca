"""Values that are usual in machines: leads of screws, counts of encoders, pairs of units that are mixed up."""

from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.importing.unit_choice import ANGLES, LENGTHS, MATCH
from hil.quantities import UNITS

COUNTS = tuple(
    float(n * k) for n in (1, 4) for k in (500, 1000, 1024, 2000, 2048, 2500, 4096, 5000, 8192, 10000)
) + tuple(2.0**power for power in range(12, 25))
USUAL = 2e-3  # relative deviation of a measured lead: following errors and lead errors are below
SURE_TURNS = 0.05  # deviation of a gear ratio from a whole number that is seldom seen by chance
LEADS_M = (0.010, 0.005, 0.020, 0.004, 0.016, 0.0025, 0.002, 0.025, 0.040, 0.008, 0.012, 0.032, 0.001)

LEAST_M, MOST_M, MOST_RAD_S = 1e-6, 100.0, 1e5  # travel of a linear axis and speed of a rotary one: beyond is asked


def usual_lead(value_m: float) -> float:
    """The usual lead that is within 0.2 %, else the value itself [m]."""
    usual = next((lead for lead in LEADS_M if abs(value_m / lead - 1.0) < USUAL), None)
    return usual if usual is not None else value_m


def screw_units(factor: float, far: str | None, motor: str | None) -> tuple[str, str] | None:
    """Units of a table (length) and a motor (angle) that give a usual lead, for table = factor x motor.

    `far` and `motor` are the units that are known. None where no lead fits, or both may be in like units.
    """
    if abs(abs(factor) - 1.0) < MATCH or mixed_up(abs(factor)):
        return None
    for lead in LEADS_M:
        for length in [far] if far else LENGTHS:
            for angle in [motor] if motor else ANGLES:
                if UNITS[length][0] != "m" or UNITS[angle][0] != "rad":
                    continue
                travel_m = 2.0 * pi * abs(factor) * UNITS[length][1] / UNITS[angle][1]
                if abs(travel_m / lead - 1.0) < USUAL:
                    return length, angle
    return None


def improbable(column: str, values: FloatArray, unit: str, period_s: float) -> list[str]:
    """Question about a position (n,) whose travel or speed no machine has in this unit; empty for a usual one."""
    si, factor = UNITS.get(unit, ("", 1.0))
    travel, speed = factor * float(np.ptp(values)), factor * float(np.abs(np.diff(values)).max()) / period_s
    if si == "m" and not LEAST_M <= travel <= MOST_M:
        return [f"{column}: a travel of {travel:.4g} m: is its unit {unit}? Correct it in the map"]
    if si == "rad" and speed > MOST_RAD_S:
        return [f"{column}: a speed of {speed:.4g} rad/s: is its unit {unit}? Correct it in the map"]
    return []


def mixed_up(ratio: float) -> str:
    """Pair of units that are confused if positions differ by `ratio`; empty for none."""
    for value, pair in (
        (1e3, "m or mm"), (1e6, "m or um"), (180.0 / pi, "rad or deg"), (360.0, "deg or revolutions"),
        (2.0 * pi, "rad or revolutions"), (25.4, "in or mm"),
    ):  # fmt: skip
        if any(abs(ratio / one - 1.0) < MATCH for one in (value, 1.0 / value)):
            return pair
    return ""
