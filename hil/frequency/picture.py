"""Bode diagrams of a frequency response: measured lines with their 95 % bounds over the twin, and the coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.arrays import FloatArray
from hil.figures.panels import COMMAND, MEASURED, NOISE, SIMULATED
from hil.frequency.curves import ResponseCurve
from hil.frequency.margins import ComplexArray, StabilityMargins
from hil.quantities import digits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hil.frequency.result import FrequencyResponse

PAIRS = (("plant_motor", "plant_table"), ("velocity_open", "position_open"), ("velocity_closed", "position_closed"))
BELOW_BAND, ABOVE_BAND = 0.7, 1.15  # drawn beyond the measured frequencies
_LEAST_DB = -400.0  # of a bound that reaches 0


def overview(result: FrequencyResponse) -> Figure:
    """Draw plant, open and closed loops in one figure."""
    from matplotlib.figure import Figure

    from hil.figures.drawing import WIDTH_IN

    pairs = [pair for pair in PAIRS if any(name in result.measured for name in pair)]
    figure = Figure(figsize=(WIDTH_IN, 5.2 * len(pairs)), layout="constrained")
    for part, pair in zip(figure.subfigures(len(pairs), 1, squeeze=False)[:, 0], pairs, strict=True):
        _draw(part, result, pair)
    return figure


def bode(result: FrequencyResponse, names: Sequence[str]) -> Figure:
    """Draw some responses side by side: magnitude, phase, coherence."""
    from matplotlib.figure import Figure

    from hil.figures.drawing import WIDTH_IN

    figure = Figure(figsize=(WIDTH_IN, 5.6), layout="constrained")
    _draw(figure, result, names)
    return figure


def _draw(figure: Any, result: FrequencyResponse, names: Sequence[str]) -> None:
    from matplotlib.ticker import FuncFormatter

    from hil.figures.drawing import legend_outside

    names = [name for name in names if name in result.measured]
    grid = figure.subplots(3, len(names), sharex="col", squeeze=False, height_ratios=(3, 2, 1))
    for column, name in zip(grid.T, names, strict=True):
        one, twin = result.measured[name], result.twin[name]
        magnitude, phase, coherence = column
        _magnitude(magnitude, one, twin)
        _phase(phase, one, twin)
        coherence.plot(one.frequency_hz, one.coherence, ".", color=MEASURED, markersize=2)
        coherence.set_ylim(0.0, 1.05)
        if margins := result.margins.get(name):
            _mark(magnitude, phase, margins)
        magnitude.set_title(one.title, loc="left", fontsize=10)
        for axis in column:
            axis.set_xscale("log")
            axis.grid(which="major", alpha=0.35)
            axis.grid(which="minor", alpha=0.12)
        coherence.set_xlabel("frequency [Hz]")
        coherence.xaxis.set_major_formatter(FuncFormatter(lambda hz, _: f"{hz:g}"))
        shown = one.frequency_hz[one.trusted] if np.any(one.trusted) else one.frequency_hz
        coherence.set_xlim(BELOW_BAND * shown[0], ABOVE_BAND * shown[-1])
    for axis, label in zip(grid[:, 0], ("magnitude [dB]", "phase [deg]", "coherence"), strict=True):
        axis.set_ylabel(label)
    legend_outside(figure, grid[0], columns=3)


def _magnitude(axis: Axes, one: ResponseCurve, twin: ResponseCurve) -> None:
    size, bound = np.abs(one.response), one.radius * one.std_error
    good = one.trusted
    level = decibels(one.response)
    low, high = decibels(size - bound), decibels(size + bound)
    label = "measured, 95 %"
    if one.unit != "1":
        axis.annotate(
            f"dB re 1 {one.unit}",
            (0.98, 0.96),
            xycoords="axes fraction",
            ha="right",
            va="top",
            fontsize=8,
            color=COMMAND,
        )
    axis.plot(one.frequency_hz[~good], level[~good], ".", color=NOISE, markersize=1.5, label="not trustworthy")
    axis.vlines(one.frequency_hz[good], low[good], high[good], color=MEASURED, linewidth=0.8, alpha=0.5)
    axis.plot(one.frequency_hz[good], level[good], ".", color=MEASURED, markersize=2.5, label=label)
    axis.plot(twin.frequency_hz, decibels(twin.response), color=SIMULATED, linewidth=1.1, label="twin")
    if np.any(good):
        seen = (twin.frequency_hz >= one.frequency_hz[good][0]) & (twin.frequency_hz <= one.frequency_hz[good][-1])
        drawn = np.r_[level[good], decibels(twin.response[seen])]
        axis.set_ylim(drawn.min() - 5.0, drawn.max() + 8.0)


def _phase(axis: Axes, one: ResponseCurve, twin: ResponseCurve) -> None:
    from matplotlib.ticker import MultipleLocator

    degrees = np.degrees(np.unwrap(np.angle(twin.response)))
    degrees -= 360.0 * np.ceil(np.round(degrees[0]) / 360.0)  # unwrapping leaves whole turns free: start in (-360, 0]
    good = one.trusted
    measured = beside(one.frequency_hz[good], one.response[good], twin.frequency_hz, degrees)
    share = np.minimum(one.radius * one.std_error[good] / np.abs(one.response[good]), 1.0)
    bound = np.degrees(np.arcsin(share))
    axis.vlines(one.frequency_hz[good], measured - bound, measured + bound, color=MEASURED, linewidth=0.8, alpha=0.5)
    axis.plot(one.frequency_hz[good], measured, ".", color=MEASURED, markersize=2.5)
    axis.plot(twin.frequency_hz, degrees, color=SIMULATED, linewidth=1.1)
    if measured.size:
        span = float(np.ptp(measured))
        axis.set_ylim(measured.min() - 25.0, measured.max() + 25.0)
        axis.yaxis.set_major_locator(MultipleLocator(45.0 if span < 300.0 else 90.0 if span < 700.0 else 180.0))


def _mark(magnitude: Axes, phase: Axes, margins: StabilityMargins) -> None:
    """Mark crossover, gain margin and the crossing that bears least delay of the measured loop."""
    marks = [
        (margins.crossover_hz, f"PM {digits(margins.phase_deg)}°"),
        (margins.gain_hz, f"GM {digits(margins.gain_db)} dB"),
    ]
    if margins.delay_hz != margins.crossover_hz:  # another crossing bears less delay
        marks.append((margins.delay_hz, f"DM {digits(1e3 * margins.delay_s)} ms"))
    for hz, text in marks:
        if np.isfinite(hz):
            for axis in (magnitude, phase):
                axis.axvline(hz, color=COMMAND, linewidth=0.8, linestyle=":")
            magnitude.annotate(
                text, (hz, 0.02), xycoords=magnitude.get_xaxis_transform(), rotation=90, fontsize=8, color=COMMAND,
                xytext=(-2, 0), textcoords="offset points", ha="right", va="bottom",
            )  # fmt: skip
    magnitude.axhline(0.0, color=COMMAND, linewidth=0.8, linestyle=":")
    phase.axhline(-180.0, color=COMMAND, linewidth=0.8, linestyle=":")


def decibels(values: ComplexArray | FloatArray) -> FloatArray:
    """20 log10 of the magnitude; very low where a bound is not positive."""
    size = values if values.dtype == np.float64 else np.abs(values)
    return np.asarray(np.where(size > 0.0, 20.0 * np.log10(np.maximum(size, 1e-20)), _LEAST_DB), dtype=np.float64)


def beside(frequency_hz: FloatArray, response: ComplexArray, line_hz: FloatArray, line_deg: FloatArray) -> FloatArray:
    """Phases (k,) [deg] of a response, by whole turns next to a line (m,) of phases."""
    line = np.interp(frequency_hz, line_hz, line_deg)
    away = (np.degrees(np.angle(response)) - line + 180.0) % 360.0 - 180.0
    return np.asarray(line + away, dtype=np.float64)
