"""Figure of the structure that a twin leaves: means over a quantity with standard errors, and the map of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from hil.diagnosis.questions import OFFSET
from hil.diagnosis.structure_left import TORQUE, Dependence, coefficient
from hil.figures.drawing import WIDTH_IN, Drawing, style_axis
from hil.figures.panels import COMMAND, MEASURED, SIMULATED
from hil.quantities import reading_unit
from hil.twin.maps import knots

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

MOST = 3  # panels: more dependences are those of the first ones, seen over another quantity
CAPTION = (
    "Mean of what the twin leaves in bins of equally many rows, with standard errors that count the autocorrelation; "
    "noise lies about 0 within two of them. Orange: the map that bench.diagnosed.yaml has for it."
)


def structure_figure(diagnosis: Diagnosis) -> Drawing | None:
    """Draw the strongest dependences of the residuals, one panel each; None where only an offset is left."""
    judged = diagnosis.reported.judged
    shown = [one for one in judged.structure if one.question.name != OFFSET][:MOST]
    if not shown:
        return None
    figure = Drawing(WIDTH_IN, 0.6 + 2.6 * len(shown))
    axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
    mapped = {id(one.dependence): one.term.values for one in judged.unnamed}
    for axis, one in zip(axes, shown, strict=True):
        _means(axis, one, diagnosis.given_bench.axis.drive_unit)
        if id(one) in mapped:
            _knots(axis, one, mapped[id(one)], diagnosis.given_bench.axis.drive_unit)
    return figure


def _units(one: Dependence, drive_unit: str) -> tuple[float, str, float, str]:
    """Factor and unit of the quantity, factor and unit of the residual."""
    along, along_unit = reading_unit(one.question.unit, float(np.max(np.abs(one.found.edges))))
    unit = drive_unit if one.channel == TORQUE else one.question.length
    if change := one.question.change:
        _, unit = coefficient(change, drive_unit)
    factor, name = reading_unit(unit, float(np.max(np.abs(one.found.means))))
    return along, along_unit, factor, name


def _means(axis: Axes, one: Dependence, drive_unit: str) -> None:
    along, along_unit, factor, unit = _units(one, drive_unit)
    found, turn = one.found, one.question.by_direction
    middle = 0.5 * (found.edges[:-1] + found.edges[1:])
    parts = [("", np.ones(middle.size, dtype=bool), MEASURED)]
    if turn:
        parts = [("moving backwards", middle < turn, COMMAND), ("moving forwards", middle >= turn, MEASURED)]
    for label, rows, colour in parts:
        x = one.question.least + middle[rows] - (turn if label == "moving forwards" else 0.0)
        y, error = factor * found.means[rows], factor * found.errors[rows]
        axis.errorbar(along * x, y, error, color=colour, label=label, fmt="o-", markersize=4, capsize=3, linewidth=0.8)
    axis.axhline(0.0, color=COMMAND, linewidth=0.8)
    what = "needed beyond the twin" if one.channel == TORQUE else "second encoder - twin"
    if change := one.question.change:
        what = f"{coefficient(change, drive_unit)[0]} beyond the twin's"
    over = "time" if one.question.change else one.question.name
    title = f"{100.0 * one.explained:.0f} % of the residual depends on the {over.partition(' (')[0]}"
    style_axis(axis, f"{what}\n[{unit}]", f"{over} [{along_unit}]", title)
    if turn:
        axis.legend(frameon=False)


def _knots(axis: Axes, one: Dependence, values: tuple[float, ...], drive_unit: str) -> None:
    along, _, factor, _ = _units(one, drive_unit)
    middle = 0.5 * (one.found.edges[:-1] + one.found.edges[1:])
    x, heights = knots((middle[0], middle[-1], *values[2:]), one.question.period)  # of speed: values are the motor's
    axis.plot(along * x, factor * heights, color=SIMULATED, linewidth=2.0)
