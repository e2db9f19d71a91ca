"""Values that are usual in machines: leads of screws, counts of encoders, pairs of units that are mixed up."""

from math import pi

from hil.drafting.unit_choice import MATCH

ROTARY_LEAD_M = 2.0 * pi  # of a rotary axis: one metre of its load stands for one radian
COUNTS = tuple(
    float(n * k) for n in (1, 4) for k in (500, 1000, 1024, 2000, 2048, 2500, 4096, 5000, 8192, 10000)
) + tuple(2.0**power for power in range(12, 25))
LEADS_M = (0.010, 0.005, 0.020, 0.004, 0.016, 0.0025, 0.002, 0.025, 0.040, 0.008, 0.012, 0.032, 0.001)


def usual_lead(value_m: float) -> float:
    """Lead with the digits of a usual one if it is that to 0.2 %: following errors and lead errors are below."""
    usual = next((lead for lead in LEADS_M if abs(value_m / lead - 1.0) < 2e-3), None)
    return usual if usual is not None else value_m


def mixed_up(ratio: float) -> str:
    """Pair of units that are confused if positions differ by `ratio`; empty for none."""
    for value, pair in (
        (1e3, "m or mm"), (1e6, "m or um"), (180.0 / pi, "rad or deg"), (360.0, "deg or revolutions"),
        (2.0 * pi, "rad or revolutions"), (25.4, "in or mm"),
    ):  # fmt: skip
        if any(abs(ratio / one - 1.0) < MATCH for one in (value, 1.0 / value)):
            return pair
    return ""
