"""Colours and units of every plot and table: what is measured, simulated, commanded, and by how much they differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

# Told apart by the colour-blind (Okabe and Ito 2008).
MEASURED, SIMULATED, COMMAND, DEVIATION, NOISE = "#0072b2", "#d55e00", "#555555", "#a3195b", "#999999"
GOOD, WARNING = "#00734d", "#b34700"

# SI unit -> what engineers read it in: (from this magnitude on, factor, text), largest first.
_SHOWN: dict[str, tuple[tuple[float, float, str], ...]] = {
    "m": ((1e-3, 1e3, "mm"), (0.0, 1e6, "µm")),
    "m/s": ((1e-3, 60.0, "m/min"), (0.0, 6e4, "mm/min")),
    "m/s^2": ((0.0, 1.0, "m/s²"),),
    "m/s^3": ((0.0, 1.0, "m/s³"),),
    "rad": ((0.1, 1.0, "rad"), (1e-4, 1e3, "mrad"), (0.0, 1e6, "µrad")),
    "N m": ((0.1, 1.0, "N m"), (0.0, 1e3, "mN m")),
    "N": ((0.0, 1.0, "N"),),
}


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: value x factor, in `unit`."""

    factor: float
    unit: str

    def text(self, value: float) -> str:
        """Three digits and the unit."""
        return f"{digits(value * self.factor)} {self.unit}"


def shown(unit: str, largest: float) -> Shown:
    """The unit in which values of an SI unit up to `largest` are read."""
    for start, factor, text in _SHOWN.get(unit, ((0.0, 1.0, unit),)):
        if abs(largest) >= start:
            return Shown(factor, text)
    raise AssertionError(unit)


def quantity(value: float, unit: str) -> str:
    """A value of an SI unit as text, such as "0.148 µm"."""
    return shown(unit, value).text(value)


def percent(value: float) -> str:
    """A ratio in percent; what is below 0.001 % is no more than that."""
    return f"{digits(100.0 * value)} %" if value >= 1e-5 else "< 0.001 %"


def digits(value: float, significant: int = 3) -> str:
    """A number with three significant digits, without exponent where that is readable."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        decimals = max(significant - 1 - int(np.floor(np.log10(abs(value) or 1.0))), 0)
        return f"{value:.{decimals}f}"
    return f"{value:.{significant - 1}e}"


def thin(columns: tuple[FloatArray, ...], limit: int) -> NDArray[np.intp]:
    """Rows to draw, at most about `limit`: of each stretch those where a column is least or greatest.

    A peak of a single sample stays a peak.
    """
    rows = columns[0].size
    if rows <= limit:
        return np.arange(rows)
    length = -(-rows * 2 * len(columns) // limit)
    stretches = rows // length
    begin = np.arange(stretches) * length
    chosen = [np.array([0, rows - 1])]
    for values in columns:
        block = values[: stretches * length].reshape(stretches, length)
        chosen += [begin + block.argmin(axis=1), begin + block.argmax(axis=1)]
    return np.unique(np.concatenate([*chosen, np.arange(stretches * length, rows)]))
