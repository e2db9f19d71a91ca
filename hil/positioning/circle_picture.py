"""Picture of a circular test: the paths with their deviation enlarged, and the radial deviation over the angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.figures.panels import COMMAND, MEASURED, SIMULATED
from hil.positioning.circle import QUADRANTS_DEG, CircularAccuracy, radial_deviation
from hil.quantities import quantity, reading_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {1: MEASURED, -1: SIMULATED}
SHOWN = 0.25  # of the radius: the largest deviation in the picture of the paths


def draw_circle(result: CircularAccuracy) -> Figure:
    """Draw both panels; angles are commanded ones, 0 at the positive end of the first axis."""
    from matplotlib.figure import Figure

    from hil.figures.drawing import WIDTH_IN, legend_outside, style_axis

    radial = {sense: radial_deviation(path) for sense, path in result.paths.items()}
    largest = max(float(np.abs(one).max()) for one in radial.values())
    small, length = reading_unit("m", largest), reading_unit("m", result.radius_m)
    figure = Figure(figsize=(WIDTH_IN, 4.4), layout="constrained")
    round_axis, over = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    enlarged = 10.0 ** np.floor(np.log10(SHOWN * result.radius_m / largest))
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    nominal = length.factor * result.radius_m
    round_axis.plot(nominal * np.cos(turn), nominal * np.sin(turn), color=COMMAND, linewidth=0.8, label="nominal")
    over.axhline(0.0, color=COMMAND, linewidth=0.8)
    for sense, path in result.paths.items():
        drawn = length.factor * (result.radius_m + enlarged * radial[sense])
        colour, line = COLOURS[sense], {"linewidth": 1.1}
        round_axis.plot(drawn * np.cos(path.angle_rad), drawn * np.sin(path.angle_rad), color=colour, **line)
        degrees = np.degrees(path.angle_rad) % 360.0
        order = np.argsort(degrees)
        over.plot(degrees[order], small.factor * radial[sense][order], color=colour, label=path.name, **line)
    style_axis(
        round_axis,
        f"{result.y_name} [{length.unit}]",
        f"{result.x_name} [{length.unit}]",
        f"deviation × {enlarged:.0f}",
    )
    round_axis.set_aspect("equal")
    style_axis(over, f"radial deviation [{small.unit}]", "angle [deg]", f"radius {quantity(result.radius_m, 'm')}")
    over.set_xlim(0.0, 360.0)
    over.set_xticks([*QUADRANTS_DEG, 360])
    legend_outside(figure, (round_axis, over))
    return figure
