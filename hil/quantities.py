"""Numbers with units: value to text, unit of a name, factor of a unit to SI.

Values are SI throughout the project; other units are used only here, for reading foreign recordings and
for showing values on pages, in pictures and in messages.
"""

import math
from math import pi
from typing import NamedTuple

# SI unit -> units of foreign recordings: value [SI unit] = factor x value [unit]
_PER_SI = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "100 ns": 1e-7, "ns": 1e-9, "min": 60.0},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048},
    "rad": {
        "rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "0.1 deg": pi / 1800, "mdeg": pi / 180e3, "arcmin": pi / 10800,
        "arcsec": pi / 648000, "rev": 2 * pi,
    },
    "m/s": {
        "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "m/min": 1 / 60, "mm/min": 1e-3 / 60,
        "in/s": 0.0254, "in/min": 0.0254 / 60, "ft/s": 0.3048, "ft/min": 0.3048 / 60,
    },
    "rad/s": {
        "rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "mdeg/s": pi / 180e3, "rev/s": 2 * pi, "rpm": 2 * pi / 60,
    },
    "m/s^2": {"m/s^2": 1.0, "mm/s^2": 1e-3},
    "rad/s^2": {"rad/s^2": 1.0, "deg/s^2": pi / 180, "rev/s^2": 2 * pi},
    "N m": {
        "N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3, "uN m": 1e-6, "N mm": 1e-3, "N cm": 1e-2, "kN m": 1e3,
        "kgf m": 9.80665, "kgf cm": 0.0980665, "gf cm": 9.80665e-5,
        "lbf ft": 1.3558179483314004, "lbf in": 0.1129848290276167, "ozf in": 0.007061551814226044,
    },
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605},
    "1": {"1": 1.0},
}  # fmt: skip
UNITS: dict[str, tuple[str, float]] = {
    unit: (si, factor) for si, units in _PER_SI.items() for unit, factor in units.items()
}
"""Unit -> (SI unit, factor): value [SI unit] = factor x value [unit]."""

# units that no map may name, but that a recording may hold by mistake: factor to SI
_MISREAD = {"km": 1e3}
_SPELLED = {"um": "µm", "um/s": "µm/s", "uN m": "µN m", "deg": "degrees", "rev": "revolutions", "in": "inches"}

ROTARY_LEAD_M = 2.0 * pi
"""Lead of a rotary axis: one metre of its load stands for one radian."""

# a screw turns rad, rad/s, rad/s^2 into m, m/s, m/s^2
_SCREW = {"rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2"}

# SI unit -> units in which engineers read it: (from this magnitude on, factor, unit), largest first
_READ_IN: dict[str, tuple[tuple[float, float, str], ...]] = {
    "m": ((10.0, 1.0, "m"), (1e-3, 1e3, "mm"), (0.0, 1e6, "µm")),
    "m/s": ((1e-3, 60.0, "m/min"), (0.0, 6e4, "mm/min")),
    "m/s^2": ((0.0, 1.0, "m/s²"),),
    "m/s^3": ((0.0, 1.0, "m/s³"),),
    "s": ((1.0, 1.0, "s"), (1e-3, 1e3, "ms"), (0.0, 1e6, "µs")),
    "rad": ((0.1, 1.0, "rad"), (1e-4, 1e3, "mrad"), (0.0, 1e6, "µrad")),
    "N m": ((0.1, 1.0, "N m"), (0.0, 1e3, "mN m")),
    "N/m": ((1e5, 1e-6, "N/µm"), (0.0, 1.0, "N/m")),
    "1": ((0.0, 100.0, "%"),),
    "m/m": ((0.0, 1e6, "µm/m"),),
    "1/rev": ((0.0, 1.0, ""),),  # the sentence says what is counted
}

# endings of names of channels and parameters, longest first where one ends with another
_ENDINGS = {
    "stiffness_n_m": "N/m",
    "v_s_rad": "V s/rad",
    "n_m_s_rad": "N m s/rad",
    "n_m_rad": "N m/rad",
    "n_s_m": "N s/m",
    "kg_m2": "kg m^2",
    "m_s3": "m/s^3",
    "m_s2": "m/s^2",
    "rad_s": "rad/s",
    "m_s": "m/s",
    "1_s": "1/s",
    "n_m": "N m",
    "rad": "rad",
    "kg": "kg",
    "v": "V",
    "hz": "Hz",
    "n": "N",
    "m": "m",
    "s": "s",
}


class ReadingUnit(NamedTuple):
    """Unit in which values are shown: shown value = factor x SI value."""

    factor: float
    unit: str


def unit_of(name: str) -> str:
    """SI unit of a channel or parameter by the ending of its name: "torque_n_m" -> "N m"; "1" without an ending."""
    padded = f"_{name}"
    return next((unit for ending, unit in _ENDINGS.items() if padded.endswith(f"_{ending}")), "1")


def reading_units(unit: str) -> tuple[tuple[float, float, str], ...]:
    """Units in which values of the SI unit `unit` are shown: (from this magnitude on, factor, unit), largest first."""
    return _READ_IN.get(unit, ((0.0, 1.0, unit),))


def reading_unit(unit: str, largest: float) -> ReadingUnit:
    """Unit in which values of the SI unit `unit` up to the magnitude `largest` are shown."""
    choices = reading_units(unit)
    return next(ReadingUnit(factor, shown) for start, factor, shown in choices if abs(largest) >= start or start == 0.0)


def digits(value: float, significant: int = 3) -> str:
    """Number with `significant` digits, without exponent from 1e-3 to 1e6."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        decimals = max(significant - 1 - math.floor(math.log10(abs(value) or 1.0)), 0)
        return f"{value:.{decimals}f}"
    return f"{value:.{significant - 1}e}"


def with_error(value: float, error: float) -> tuple[str, str]:
    """Value and standard error as texts: the error with two digits, the value to the last of them."""
    known = math.isfinite(error) and error > 0.0
    if not known or not (value == 0.0 or 1e-3 <= abs(value) < 1e6) or error < 1e-6 * abs(value):
        return digits(value, 4), digits(error, 2)
    decimals = max(1 - math.floor(math.log10(error)), 0)
    return f"{value:.{decimals}f}", f"{error:.{decimals}f}"


def rounded_to_error(value: float, error: float) -> str:
    """Number for a file, rounded at the second digit of its standard error, with at least two digits.

    With six digits where no error is known.
    """
    if value == 0.0 or not (math.isfinite(error) and error > 0.0):
        return f"{value:.6g}"
    first, last = math.floor(math.log10(abs(value))), math.floor(math.log10(error)) - 1
    further = min(max(first - last, 1), 11)  # a bit-identical replay has hardly an error
    if 1e-3 <= abs(value) < 1e6:
        return f"{round(value, further - first):.{max(further - first, 0)}f}"
    return f"{value:.{further}e}"


def quantity(value: float, unit: str) -> str:
    """Value of an SI unit as text with three digits, such as "24.7 µm"."""
    factor, shown = reading_unit(unit, value)
    return f"{digits(value * factor)} {shown}".rstrip()


def known_quantity(value: float, error: float, unit: str) -> str:
    """Value of an SI unit as text, such as "0.8 mrad", rounded at the first digit of its standard error.

    It has three digits at most, as without an error.
    """
    if value == 0.0 or not (math.isfinite(error) and error > 0.0):
        return quantity(value, unit)
    factor, shown = reading_unit(unit, value)
    known = math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    significant = min(max(known, 1), 3)
    return f"{digits(float(f'{value * factor:.{significant - 1}e}'), significant)} {shown}".rstrip()


def percent(value: float) -> str:
    """Ratio in percent with three digits; below 0.001 % only the bound."""
    return f"{digits(100.0 * value)} %" if value >= 1e-5 else "< 0.001 %"


def change(value: float, nominal: float) -> str:
    """Relative change from `nominal` to `value` in percent; a dash where `nominal` is not positive."""
    return f"{100.0 * (value / nominal - 1.0):+.1f} %" if nominal > 0.0 else "–"


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
    """Units that convert to `si`."""
    return [unit for unit in UNITS if si_factor(unit, si, lead_m) is not None]


def misread_factors(*units: str) -> dict[float, str]:
    """Factor by which a channel is wrong if it is in one of `units` but read as SI, with the unit's name."""
    factors = {unit: factor for unit, (_, factor) in UNITS.items()} | _MISREAD
    return {1.0 / factors[unit]: _SPELLED.get(unit, unit) for unit in units}
