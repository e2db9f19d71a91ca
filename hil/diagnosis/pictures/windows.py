"""Figure of an event: the force that the twin lacks over time, measured, with the windows found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.diagnosis.pictures.view import Captioned, View, torque_of
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
from hil.figures.panels import COMMAND, DEVIATION, MEASURED, SIMULATED, thin

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

MOST_RUNS = 4  # panels of a figure; those with windows first
DRAWN_ROWS = 6000  # several per pixel


def force_over_time(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw the force that the twins of the bench file and without the event lack, with the windows of the event."""
    shown = sorted(views, key=lambda view: not view.term.windows_of(view.run.name))[:MOST_RUNS]
    shown.sort(key=lambda view: view.run.start.time_s)
    ratio = diagnosis.given_bench.axis.ratio_m_rad
    figure = Drawing(WIDTH_IN, 1.8 + 2.0 * len(shown))
    axes = np.atleast_1d(figure.subplots(len(shown), 1))
    for axis, view in zip(axes, shown, strict=True):
        run, observer_s = view.run, diagnosis.train.observer_s
        given = diagnosis.residuals(diagnosis.searched.given, run)["motor"]
        of_bench_file = torque_of(run, given, diagnosis.given_bench, observer_s).torque / ratio
        modelled = view.torque.torque - view.torque_after.torque
        curves = modelled / ratio, view.torque.torque / ratio, of_bench_file
        rows = slice(run.evaluated.start, None)
        chosen = thin(tuple(values[rows] for values in curves), DRAWN_ROWS)
        looks = (
            ("fitted", SIMULATED, 3.0, 0.5),
            ("measured, without it", MEASURED, 1.2, 1.0),
            ("measured, bench file", COMMAND, 0.7, 1.0),
        )
        for values, (label, colour, width, alpha) in zip(curves, looks, strict=True):
            time_s, drawn = run.time_s[rows][chosen], values[rows][chosen]
            axis.plot(time_s, drawn, color=colour, linewidth=width, alpha=alpha, label=label)
        first_s, last_s = run.time_s[rows][[0, -1]].tolist()
        for start_s, end_s in (view.term.edges(one) for one in view.term.windows if one.run == run.name):
            if start_s < last_s and end_s > first_s:
                axis.axvspan(max(start_s, first_s), min(end_s, last_s), color=DEVIATION, alpha=0.15, linewidth=0.0)
        strongest = max((abs(force) for force, *_ in view.term.windows_of(run.name)), default=0.0)
        if strongest > 0.0:  # peaks at reversals would hide the windows
            axis.set_ylim(-1.6 * strongest, 1.6 * strongest)
        style_axis(axis, "force [N]", title=run.name)
    legend_outside(figure, axes[:1])
    axes[-1].set_xlabel("time [s]")
    return Captioned(
        figure,
        "Force on the table that the twin lacks, from the motion that its torque does not explain; shaded: the windows "
        "found.",
    )
