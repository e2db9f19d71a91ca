"""The diagram of ISO 230-2: mean deviations with their bands of 2 s over the position, forward and backward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.figures.panels import COMMAND, MEASURED, SIMULATED
from hil.quantities import reading_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hil.positioning.accuracy import PositioningAccuracy

WAYS = (("forward", MEASURED, "^"), ("backward", SIMULATED, "v"))


def deviations_over_position(results: Sequence[PositioningAccuracy]) -> Figure:
    """Draw a panel for each run, all in one scale."""
    from matplotlib.figure import Figure

    from hil.figures.drawing import WIDTH_IN, legend_outside, style_axis

    figure = Figure(figsize=(WIDTH_IN, 0.9 + 3.0 * len(results)), layout="constrained")
    axes = figure.subplots(len(results), 1, squeeze=False, sharex=True, sharey=True)[:, 0]
    unit = results[0].unit
    length = reading_unit(unit, max(float(np.abs(one.target_m).max()) for one in results))
    small = reading_unit(unit, max(float(np.abs(one.mean_m).max() + one.estimator_m.max()) for one in results))
    for axis, one in zip(axes, results, strict=True):
        place = length.factor * one.target_m
        cycles = (one.deviations.forward_m, one.deviations.backward_m)
        for (way, colour, mark), mean, estimator, every in zip(WAYS, one.mean_m, one.estimator_m, cycles, strict=True):
            band = 2.0 * estimator
            axis.fill_between(
                place,
                small.factor * (mean - band),
                small.factor * (mean + band),
                color=colour,
                alpha=0.18,
                linewidth=0,
                label=f"{way}, mean ± 2s",
            )
            axis.plot(place, small.factor * mean, color=colour, marker=mark, markersize=5, label=f"{way}, mean")
            axis.plot(place, small.factor * every, ".", color=colour, markersize=3, alpha=0.6)
        axis.plot(place, small.factor * one.mean_m.mean(axis=0), "--", color=COMMAND, linewidth=1, label="mean of both")
        axis.plot([], [], ".", color=COMMAND, markersize=3, label="single cycles")
        style_axis(axis, f"deviation [{small.unit}]", title=one.name)
        axis.axhline(0.0, color=COMMAND, linewidth=0.6)
    axes[-1].set_xlabel(f"target position [{length.unit}]")
    legend_outside(figure, axes[:1], columns=3)
    return figure
