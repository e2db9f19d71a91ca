"""Figures of a comparison and of a friction identification."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.figures.panels import DEVIATION, MEASURED, SIMULATED, Line, Panel

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing
    from hil.identification.compare import Comparison
    from hil.identification.friction import FrictionResult
    from hil.identification.twin_deviation import Deviation

MOVE_MARGIN_S = 0.1  # standstill shown before and after the fastest move: enough for the settling


def motion_panels(result: Comparison) -> list[Panel]:
    """Panels of position to torque, measured and simulated, then of the deviations of position and torque."""
    chosen = [channel for channel in result.channels if channel.name != "motor_position"]
    position, torque = chosen[0], chosen[-1]
    return [
        *(_pair(channel.label, channel) for channel in chosen),
        _difference(f"deviation of\n{position.label}", position, 0.0),
        _difference(f"deviation of\n{torque.label}", torque, result.measured.noise.torque),
    ]


def block_panels(result: Comparison) -> list[Panel]:
    """Panels of each block's output, measured and simulated, each followed by the deviation."""
    return [
        panel
        for block in result.blocks
        for panel in (
            _pair(f"{block.deviation.name}:\n{block.deviation.label}", block.deviation),
            _difference("deviation", block.deviation, block.noise),
        )
    ]


def fastest_move(result: Comparison) -> slice:
    """Rows from standstill to standstill of the set-points around their greatest speed."""
    speed = np.abs(result.measured.velocity_command_m_s)
    peak = int(np.argmax(speed))
    still = np.flatnonzero(speed <= 1e-3 * speed[peak])
    margin = round(MOVE_MARGIN_S / result.measured.period_s)
    begin = still[still < peak].max(initial=0) - margin
    end = still[still > peak].min(initial=speed.size) + margin
    return slice(max(int(begin), 0), min(int(end), speed.size))


def _pair(label: str, channel: Deviation) -> Panel:
    lines = Line("measured", channel.measured, MEASURED, broad=True), Line("simulated", channel.simulated, SIMULATED)
    return Panel(label, channel.unit, lines)


def _difference(label: str, channel: Deviation, noise: float) -> Panel:
    values = np.where(np.arange(channel.measured.size) < channel.evaluated.start, 0.0, channel.values)
    return Panel(label, channel.unit, (Line("measured - simulated", values, DEVIATION),), noise)


def friction_figure(result: FrictionResult) -> Drawing:
    """Draw torque over speed with the regression line, and below it the residuals."""

    from hil.figures.drawing import Drawing, style_axis

    units = result.units
    speed = np.array([point.speed for point in result.points])
    torque = np.array([point.torque for point in result.points])
    figure = Drawing(9.0, 7.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    top.plot(speed, torque, "o", color=MEASURED, label=f"measured: {speed.size} stretches of constant feed")
    edge = 1.05 * float(np.abs(speed).max())
    for side in (-1.0, 1.0):
        line = side * np.array([1e-9, edge])  # one line per side: friction jumps at standstill
        label = f"{units.quantity} = Coulomb sign(speed) + viscous speed + offset" if side > 0 else None
        top.plot(line, result.torque(line), color=SIMULATED, label=label)
    top.axhline(0.0, color="black", linewidth=0.8)
    top.axvline(0.0, color="black", linewidth=0.8)
    top.legend(loc="upper left")
    text = (
        f"Coulomb {_with_error(result.coulomb, result.coulomb_std_error)} {units.coulomb}\n"
        f"viscous {_with_error(result.viscous, result.viscous_std_error)} {units.viscous}\n"
        f"offset {_with_error(result.offset, result.offset_std_error)} {units.coulomb}"
    )
    top.text(0.98, 0.04, text, transform=top.transAxes, ha="right", va="bottom", family="monospace")
    style_axis(top, f"mean {units.quantity} [{units.coulomb}]", title="Friction at constant feed (± standard error)")
    residual = torque - result.torque(speed)
    bottom.axhline(0.0, color=SIMULATED)
    bottom.vlines(speed, 0.0, residual, color=MEASURED, linewidth=1.0)
    bottom.plot(speed, residual, "o", color=MEASURED)
    style_axis(bottom, f"measured - line [{units.coulomb}]", f"motor speed [{units.speed}]")
    return figure


def _with_error(value: float, error: float) -> str:
    """Format a value and its error so that the error has two digits."""
    if error <= 0.0 or not np.isfinite(error):
        return f"{value:.6g}"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"
