"""Figure of a change of the axis: the residual torque of one set of parameters, and of those of each part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.pictures.view import label_of_channel, torque_of, unit_of_channel
from hil.diagnosis.wording import whole_name
from hil.errors import InputError
from hil.figures.drawing import WIDTH_IN, Drawing, legend_above, style_axis
from hil.figures.panels import COMMAND, DEVIATION, SIMULATED, thin
from hil.identification.estimator import Fit
from hil.quantities import reading_unit

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

DRAWN_ROWS = 6000  # several per pixel
CAPTION = (
    "Residual with one set of parameters for all recordings, and with those of each part. The line marks "
    "the moment of the change."
)


def change_figure(diagnosis: Diagnosis) -> Drawing:
    """Draw the residual of each recording over time. Raises InputError if the axis did not change."""
    change = diagnosis.reported.judged.change
    if change is None:
        raise InputError("change: the axis did not change between or during these recordings")
    figure = Drawing(WIDTH_IN, 1.0 + 2.4 * len(change.runs))
    axes = figure.subplots(len(change.runs), 1, squeeze=False)[:, 0]
    whole = diagnosis.reported.judged.final if change.explains_all else diagnosis.nominal
    for axis, run in zip(axes, change.runs, strict=True):
        channel = "motor" if run.observability.torque_measured else "table"
        before = _residual(whole.on(diagnosis.train.over([run])), channel)
        after = np.full(run.motor.size, np.nan)
        for part in change.parts:
            for own in (one for one in part.data.runs if one.name == run.name):
                left = _residual(part.on(part.data.over([own])), channel)
                after[: own.motor.size][own.evaluated] = left[own.evaluated]
        drawn = run.evaluated
        time_s, lines = run.time_s[drawn], [before[drawn], after[drawn]]
        chosen = thin([np.nan_to_num(values) for values in lines], DRAWN_ROWS)
        factor, unit = reading_unit(unit_of_channel(diagnosis, channel), float(np.abs(lines[0]).max()))
        axis.plot(
            time_s[chosen],
            factor * lines[0][chosen],
            color=COMMAND,
            linewidth=2.0,
            alpha=0.5,
            label="one set of parameters",
        )
        axis.plot(time_s[chosen], factor * lines[1][chosen], color=SIMULATED, linewidth=0.9, label="those of each part")
        moment_s = change.summary.moment_s if change.summary.recording == whole_name(run.name) else None
        if moment_s is not None and time_s[0] <= moment_s <= time_s[-1]:
            axis.axvline(moment_s, color=DEVIATION, linewidth=1.4, label=f"{moment_s:.2f} s")
        style_axis(axis, f"{label_of_channel(diagnosis, channel)}\n[{unit}]", f"time of {run.name} [s]")
        legend_above(axis)
    return figure


def _residual(fit: Fit, channel: str) -> FloatArray:
    """Residual (n,) of the only run of a fit; that of the motor as the torque that causes it."""
    (run,), (channels,) = fit.data.runs, fit.residuals.channels
    if channel == "motor":
        return torque_of(run, channels["motor"], fit.bench, fit.data.observer_s).torque
    return channels[channel]
