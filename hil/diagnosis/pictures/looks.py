"""Looks that the figures of all findings share: measured points with their errors, and curves of twins and laws."""

from typing import Literal

from matplotlib.axes import Axes

from hil.arrays import FloatArray
from hil.figures.panels import COMMAND, MEASURED, SIMULATED

POINTS = "measured, ± 2 σ"  # standard errors
LAW, WITHOUT = "fitted law", "without it"
TWINS = {"before": ("twin before", COMMAND, 1.1), "after": ("twin after", SIMULATED, 1.6)}


def points(
    axis: Axes,
    x: FloatArray,
    y: FloatArray,
    error: FloatArray | float,
    label: str = POINTS,
    colour: str = MEASURED,
    marker: str = "o",
) -> None:
    """Draw measured points with two standard errors on either side."""
    axis.errorbar(x, y, 2.0 * error, fmt=marker, color=colour, markersize=3.8, linewidth=1.0, label=label, zorder=4)


def law(axis: Axes, x: FloatArray, y: FloatArray, label: str = LAW, colour: str = SIMULATED) -> None:
    """Draw the curve of a fitted law."""
    axis.plot(x, y, color=colour, linewidth=1.8, label=label, zorder=3)


def without(axis: Axes, x: FloatArray, y: FloatArray) -> None:
    """Draw the curve that there would be without the mechanism."""
    axis.plot(x, y, color=COMMAND, linestyle="--", linewidth=1.1, label=WITHOUT)


def twin(axis: Axes, x: FloatArray, y: FloatArray, which: Literal["before", "after"]) -> None:
    """Draw a signal of the twin without the mechanism, or with it."""
    label, colour, width = TWINS[which]
    axis.plot(x, y, color=colour, linewidth=width, label=label)


def trace(axis: Axes, x: FloatArray, y: FloatArray) -> None:
    """Draw a measured signal over time, wide and pale under the twins."""
    axis.plot(x, y, color=MEASURED, linewidth=2.6, alpha=0.5, label="measured")
