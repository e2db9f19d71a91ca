"""Figure of a term over time: the residual without it, and with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.diagnosis.pictures.view import Captioned, View, around, label_of_channel, unit_of_channel
from hil.figures.drawing import WIDTH_IN, Drawing, legend_above, style_axis
from hil.figures.panels import COMMAND, MEASURED, thin
from hil.quantities import reading_unit

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

DRAWN_ROWS = 6000  # several per pixel
ENLARGED_S = 0.3


def residual_over_time(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the residual in the channel in which the term is largest; below, enlarged about its maximum."""
    view = views[0]
    run, channel = view.run, view.strongest
    before, after = view.residuals(channel)
    factor, unit = reading_unit(unit_of_channel(diagnosis, channel), float(np.abs(before[run.evaluated]).max()))
    figure = Drawing(WIDTH_IN, 5.6)
    axes = figure.subplots(2, 1)
    middle = run.evaluated.start + int(np.argmax(np.abs((before - after)[run.evaluated])))
    for axis, rows in zip(axes, (slice(run.evaluated.start, None), around(middle, run, ENLARGED_S)), strict=True):
        chosen = thin((before[rows], after[rows]), DRAWN_ROWS)
        time_s = run.time_s[rows][chosen]
        axis.plot(time_s, factor * before[rows][chosen], color=COMMAND, linewidth=2.0, alpha=0.5, label="before")
        axis.plot(time_s, factor * after[rows][chosen], color=MEASURED, linewidth=1.0, label="after")
        style_axis(axis, f"{label_of_channel(diagnosis, channel)} [{unit}]")
    legend_above(axes[0])
    axes[-1].set_xlabel("time [s]")
    return Captioned(
        figure, "Measured - twin without this term and with it; below, enlarged about where the term is largest."
    )
