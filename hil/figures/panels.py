"""Panels over a common time axis as data, and the colours of every picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.quantities import ReadingUnit, reading_unit

# distinguishable with colour blindness (Okabe and Ito 2008)
MEASURED, SIMULATED, COMMAND, DEVIATION, NOISE = "#0072b2", "#d55e00", "#555555", "#a3195b", "#999999"
GOOD, WARNING = "#00734d", "#b34700"
GOOD_IN_DARK, WARNING_IN_DARK = "#3fc08f", "#ff9a4d"


@dataclass(frozen=True, eq=False)
class Line:
    """A line (n,) of a panel in SI units; a `broad` one is drawn wide and pale under the others."""

    label: str
    values: FloatArray
    colour: str
    broad: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """Lines on a common axis; `unit` is their SI unit, `band` a value (1 sigma of noise) drawn as +- band in grey."""

    label: str
    unit: str
    lines: tuple[Line, ...]
    band: float = 0.0

    def shown(self, rows: slice = slice(None)) -> ReadingUnit:
        """Unit in which the panel is read, by the largest value in `rows`."""
        return reading_unit(self.unit, max(float(abs(line.values[rows]).max()) for line in self.lines))


def thin(columns: Sequence[FloatArray], limit: int) -> NDArray[np.intp]:
    """Rows to draw, about `limit` at most: the least and greatest of each column in each stretch of rows."""
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
