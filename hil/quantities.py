"""Units of foreign recordings and their factors to the SI units of the channel table."""

from __future__ import annotations

from math import pi

_PER_SI = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "m": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "rev": 2 * pi},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "um/s": 1e-6, "m/min": 1 / 60, "mm/min": 1e-3 / 60, "in/min": 0.0254 / 60},
    "rad/s": {"rad/s": 1.0, "deg/s": pi / 180, "rev/s": 2 * pi, "rpm": 2 * pi / 60},
    "m/s^2": {"m/s^2": 1.0, "mm/s^2": 1e-3},
    "rad/s^2": {"rad/s^2": 1.0, "deg/s^2": pi / 180, "rev/s^2": 2 * pi},
    "N m": {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3},
    "N": {"N": 1.0, "kN": 1e3},
    "1": {"1": 1.0},
}
UNITS: dict[str, tuple[str, float]] = {
    unit: (si, factor) for si, units in _PER_SI.items() for unit, factor in units.items()
}
"""Unit -> (SI unit, factor): value [SI unit] = factor x value [unit]."""

# a screw turns rad, rad/s, rad/s^2 into m, m/s, m/s^2
_SCREW = {"rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2"}


def si_factor(unit: str, si: str, lead_m: float | None = None) -> float | None:
    """Factor from `unit` to the SI unit `si`; None if there is none.

    With the lead of a screw, angle and length convert into each other: x = lead / (2 pi) theta.
    """
    own, factor = UNITS.get(unit, (None, 1.0))
    if own == si:
        return factor
    if own is None or lead_m is None:
        return None
    radius = lead_m / (2 * pi)
    if _SCREW.get(own) == si:
        return factor * radius
    return factor / radius if _SCREW.get(si) == own else None


def units_of(si: str, lead_m: float | None = None) -> list[str]:
    """The units that convert to `si`."""
    return [unit for unit in UNITS if si_factor(unit, si, lead_m) is not None]
