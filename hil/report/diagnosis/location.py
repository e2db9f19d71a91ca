"""Pictures of where a mismatch is, and of what is left before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.channels import CHANNELS
from hil.diagnosis.diagnose import Diagnosis
from hil.diagnosis.location.locate import BLOCKS, block_shares, mismatch_energies, phase_shares
from hil.diagnosis.location.residual_energy import Energy
from hil.diagnosis.result import Mode, Verdict
from hil.diagnosis.verdict.fit_table import channel_names
from hil.diagnosis.wording import title
from hil.identification.dataset import Measured
from hil.identification.estimator import Fit
from hil.report import style
from hil.report.figures import Line, Panel, style_axis

_BINS = 40


def location_figure(diagnosis: Diagnosis) -> Figure:
    """Shares of blocks and phases; energy over time, position and speed, per second spent there."""
    before = first_hypothesis(diagnosis)
    seen = mismatch_energies(before, diagnosis.final)
    figure = Figure(figsize=(10.0, 8.2), layout="constrained")
    axes = figure.subplot_mosaic([["block", "phase"], ["position", "speed"], ["time", "time"]])
    shares = block_shares(before)
    names = [f"{title(BLOCKS[name][0])}" for name in shares]
    axes["block"].barh(names, [100.0 * value for value in shares.values()], color=style.MEASURED)
    axes["block"].set_title("Block whose output it shows in", loc="left")
    phases = phase_shares(seen)
    axes["phase"].barh(
        [title(phase.kind) for phase in phases], [100.0 * phase.share for phase in phases], color=style.MEASURED
    )
    axes["phase"].set_title("Phase of motion it arises in", loc="left")
    for name in ("block", "phase"):
        axes[name].invert_yaxis()
        axes[name].set_xlabel("share of the energy above the noise [%]")
    _density(axes["position"], [1e3 * energy.run.position_command_m for energy in seen], seen)
    axes["position"].set_xlabel("position of the table [mm]")
    axes["position"].set_title("Over the travel", loc="left")
    _density(axes["speed"], [60.0 * np.abs(energy.run.velocity_command_m_s) for energy in seen], seen)
    axes["speed"].set_xlabel("speed of the table [m/min]")
    axes["speed"].set_title("Over the speed", loc="left")
    first = seen[0]
    size = max(round(0.05 / first.run.period_s), 1)
    starts = np.arange(0, first.rows.size, size)
    power = np.maximum(np.add.reduceat(first.rows, starts), 0.0) / size
    axes["time"].fill_between(first.run.time_s[starts], power, color=style.DEVIATION, linewidth=0.0, step="post")
    speed = axes["time"].twinx()
    speed.plot(first.run.time_s, 60.0 * first.run.velocity_command_m_s, color=style.COMMAND, linewidth=0.7)
    speed.set_ylabel("speed set-point [m/min]")
    style_axis(axes["time"], "energy over noise")
    axes["time"].set_xlabel("time [s]")
    axes["time"].set_title(f"Over time: {first.run.name}", loc="left")
    return figure


def first_hypothesis(diagnosis: Diagnosis) -> Fit:
    """The hypothesis whose mismatch is located: the bench file's, if only its parameters are wrong."""
    if diagnosis.result.verdict in (Verdict.PARAMETER_ERROR, Verdict.NO_MISMATCH):
        return diagnosis.explanation.owner
    return diagnosis.explanation.nominal


def residual_panels(diagnosis: Diagnosis, run: Measured) -> list[Panel]:
    """What is left of each channel before and after, with the noise floor as a band."""
    figures = diagnosis.result.fit
    held_out = any(run is other for other in diagnosis.held_out.runs)
    fits = (("before", first_hypothesis(diagnosis), style.COMMAND), ("after", diagnosis.final, style.SIMULATED))
    panels = []
    for channel, recorded in channel_names(diagnosis.owner, run).items():
        if recorded not in figures:
            continue
        entry = figures[recorded]
        floor = (entry.validate_ if held_out and entry.validate_ else entry.train).noise_floor_rms
        lines = tuple(
            Line(label, _judged(diagnosis.residuals(fit, run, entry.mode)[channel], run), colour, label == "before")
            for label, fit, colour in fits
        )
        what = "closed loop" if entry.mode is Mode.CLOSED_LOOP else "block by block"
        panels.append(Panel(f"{recorded}\n{what}", CHANNELS[recorded].unit, lines, floor))
    return panels


def _judged(values: FloatArray, run: Measured) -> FloatArray:
    return np.where(np.arange(values.size) < run.judged.start, 0.0, values)


def _density(axis, labels: Sequence[FloatArray], seen: Sequence[Energy]) -> None:  # type: ignore[no-untyped-def]
    """Energy per row spent in each bin of a quantity."""
    x, rows = np.concatenate(list(labels)), np.concatenate([energy.rows for energy in seen])
    edges = np.linspace(float(x.min()), float(x.max()) + 1e-12, _BINS + 1)
    held, _ = np.histogram(x, edges, weights=rows)
    time, _ = np.histogram(x, edges)
    axis.stairs(np.maximum(held, 0.0) / np.maximum(time, 1), edges, color=style.MEASURED, fill=True)
    style_axis(axis, "energy over noise")
