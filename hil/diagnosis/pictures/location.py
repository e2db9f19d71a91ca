"""Figures of the location of a mismatch, and of the residuals before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from hil.arrays import FloatArray
from hil.diagnosis.location.locate import block_shares, mismatch_energies, phase_shares, shown_in
from hil.diagnosis.result import Verdict
from hil.diagnosis.turning import speed_unit
from hil.diagnosis.wording import channel_names, spoken, title
from hil.figures.drawing import WIDTH_IN, Drawing, style_axis
from hil.figures.panels import COMMAND, DEVIATION, MEASURED, SIMULATED, Line, Panel
from hil.identification.derivatives import matched
from hil.identification.estimator import Fit
from hil.identification.intended_motion import measured_motion
from hil.identification.measured import Measured
from hil.identification.torque_left import fit_plain, needed_torque
from hil.quantities import quantity

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

BINS = 40  # as in the location
TIME_BIN_S = 0.05  # resolves single moves
ENERGY = "residual² / noise²"


def location_figure(diagnosis: Diagnosis) -> Drawing:
    """Draw shares of the residual energy by block and phase, and its mean over position, speed and time."""
    before = shown_in(reference_fit(diagnosis), diagnosis.held_out)
    seen = mismatch_energies(before, diagnosis.final)
    figure = Drawing(WIDTH_IN, 8.2)
    names = channel_names(diagnosis.given_bench, diagnosis.train.runs[0])
    shares = {
        "Channel that shows it": {spoken(names[name]): share for name, share in block_shares(before).items()},
        "Phase of motion": {title(phase.kind): phase.share for phase in phase_shares(seen)},
    }
    told = [heading for heading, own in shares.items() if any(own.values())]  # none below the noise of a row
    first: list[Any] = [[told[0], told[-1]]] if told else []
    axes = figure.subplot_mosaic([*first, ["position", "speed"], ["time", "time"]])
    for heading in told:
        _shares(axes[heading], shares[heading], heading)
    excess = np.concatenate([energy.rows for energy in seen])
    turns = diagnosis.given_bench.axis.turns
    position = np.concatenate([(180.0 / np.pi if turns else 1e3) * energy.run.position_command_m for energy in seen])
    factor, unit = speed_unit(turns)
    speed = np.concatenate([factor * np.abs(energy.run.velocity_command_m_s) for energy in seen])
    _density(axes["position"], position, excess)
    where = "angle of the load [°]" if turns else "position of the table [mm]"
    style_axis(axes["position"], ENERGY, where, "Mean over the travel")
    _density(axes["speed"], speed, excess)
    style_axis(axes["speed"], ENERGY, f"speed of the {'load' if turns else 'table'} [{unit}]", "Mean over the speed")
    run, rows = seen[0].run, seen[0].rows
    size = max(round(TIME_BIN_S / run.period_s), 1)
    starts = np.arange(0, rows.size, size)
    power = np.maximum(np.add.reduceat(rows, starts), 0.0) / size
    axes["time"].fill_between(run.time_s[starts], power, color=DEVIATION, alpha=0.45, linewidth=0.0, step="post")
    what = "speed set-point" if run.observability.closed_loop else "speed"  # without a law it may be the measured one
    style_axis(axes["time"], ENERGY, "time [s]", f"Over time: {run.name}; grey: {what}")
    set_point = axes["time"].twinx()
    set_point.plot(run.time_s, factor * run.velocity_command_m_s, color=COMMAND, linewidth=0.7)
    set_point.set_ylabel(f"{what} [{unit}]")
    return figure


def reference_fit(diagnosis: Diagnosis) -> Fit:
    """Return the fit whose mismatch is located: that of the bench file if only parameters are wrong, else the refit."""
    if diagnosis.result.verdict in (Verdict.PARAMETER_ERROR, Verdict.NO_MISMATCH):
        return diagnosis.searched.given
    return diagnosis.nominal


def residual_panels(diagnosis: Diagnosis, run: Measured) -> list[Panel]:
    """Residual of each channel of a run before and after, with the noise floor as a band."""
    held_out = any(run is other for other in diagnosis.held_out.runs)
    panels = []
    for channel, recorded in channel_names(diagnosis.given_bench, run).items():
        if recorded not in diagnosis.result.fit:
            continue
        entry = diagnosis.result.fit[recorded]
        floor = (entry.validate_ if held_out and entry.validate_ else entry.train).noise_floor_rms
        first, second = (
            _judged(diagnosis.residuals(fit, run, entry.mode)[channel], run)
            for fit in (reference_fit(diagnosis), diagnosis.final)
        )
        lines = Line("before", first, COMMAND, broad=True), Line("after", second, SIMULATED)
        panels.append(Panel(f"{spoken(recorded)}\n{title(entry.mode)}", entry.unit, lines, floor))
    return [*panels, *_torque_panels(diagnosis, run)]


def _torque_panels(diagnosis: Diagnosis, run: Measured) -> list[Panel]:
    """The measured torque, and what of it the twin lacks before and after where the axis slides: means over a window.

    An effect below the noise of a position shows here. None where nothing slides, or a twin does not hold the motion.
    """
    data, unit = diagnosis.train, diagnosis.given_bench.axis.drive_unit
    plain = fit_plain(data)
    if plain is None or not data.observability.torque_measured:
        return []
    own, lacking = measured_motion(run), list[FloatArray]()
    for fit in (reference_fit(diagnosis), diagnosis.final):
        (series,) = needed_torque(fit.hypothesis, data.over((run,)), plain)
        if not np.isfinite(series.left).all():
            return []
        mean = matched(series.left, own.window)
        lacking.append(_judged(np.where(series.rows & series.clear, mean, 0.0), run))
    lines = Line("before", lacking[0], COMMAND, broad=True), Line("after", lacking[1], SIMULATED)
    over = quantity(own.window * run.period_s, "s")
    return [
        Panel("measured torque", unit, (Line("measured", own.torque, MEASURED),)),
        Panel(f"torque lacking\n(mean, {over})", unit, lines),
    ]


def _judged(values: FloatArray, run: Measured) -> FloatArray:
    return np.where(np.arange(values.size) < run.evaluated.start, 0.0, values)


def _shares(axis: Axes, shares: dict[str, float], heading: str) -> None:
    axis.barh(list(shares), [100.0 * share for share in shares.values()], color=MEASURED)
    axis.invert_yaxis()
    axis.set_xlabel("energy above the noise [%]")
    axis.set_title(heading, loc="left")


def _density(axis: Axes, x: FloatArray, excess: FloatArray) -> None:
    """Draw the mean of the energy above the noise (n,) per row in each bin of x (n,)."""
    edges = np.linspace(float(x.min()), float(x.max()) + 1e-12, BINS + 1)
    total, _ = np.histogram(x, edges, weights=excess)
    rows, _ = np.histogram(x, edges)
    axis.stairs(np.maximum(total, 0.0) / np.maximum(rows, 1), edges, color=MEASURED, fill=True)
