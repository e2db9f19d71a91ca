"""Picture of a friction identification: torque over speed at constant feed, and the line through it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from hil.channels import AxisKind
from hil.identification.friction import FrictionResult

MEASURED, LINE = "#0072b2", "#d55e00"  # told apart by the colour-blind
_UNITS = {  # quantity, its unit, unit of viscous friction, label of the speed axis
    AxisKind.ROTARY: ("torque", "N m", "N m s/rad", "motor speed [rad/s]"),
    AxisKind.LINEAR: ("force", "N", "N s/m", "speed [m/s]"),
}


def friction_figure(result: FrictionResult) -> Figure:
    """Points and regression over speed, and below it what the line leaves out."""
    quantity, unit, viscous_unit, speed_label = _UNITS[result.kind]
    speed = np.array([point.speed for point in result.points])
    torque = np.array([point.torque for point in result.points])

    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    top.plot(speed, torque, "o", color=MEASURED, label=f"measured: {len(speed)} stretches of constant feed")
    edge = 1.05 * float(np.abs(speed).max())
    for side in (-1.0, 1.0):
        # two points a side: the line jumps at standstill
        line = side * np.array([1e-9, edge])
        label = f"{quantity} = Coulomb sign(speed) + viscous speed + offset" if side > 0 else None
        top.plot(line, result.torque(line), color=LINE, label=label)
    top.axhline(0.0, color="black", linewidth=0.8)
    top.axvline(0.0, color="black", linewidth=0.8)
    top.set_ylabel(f"mean {quantity} [{unit}]")
    top.legend(loc="upper left")
    text = (
        f"Coulomb {_value(result.coulomb, result.coulomb_std_error)} {unit}\n"
        f"viscous {_value(result.viscous, result.viscous_std_error)} {viscous_unit}\n"
        f"offset {_value(result.offset, result.offset_std_error)} {unit}"
    )
    top.text(0.98, 0.04, text, transform=top.transAxes, ha="right", va="bottom", family="monospace")
    top.set_title("Friction at constant feed (± standard error)", loc="left")

    bottom.axhline(0.0, color=LINE)
    bottom.vlines(speed, 0.0, torque - result.torque(speed), color=MEASURED, linewidth=1.0)
    bottom.plot(speed, torque - result.torque(speed), "o", color=MEASURED)
    bottom.set_ylabel(f"measured - line [{unit}]")
    bottom.set_xlabel(speed_label)
    for axes in (top, bottom):
        axes.grid(alpha=0.3)
    return figure


def _value(value: float, error: float) -> str:
    """A value with its error, in as many digits as the error leaves two of."""
    if error <= 0.0 or not np.isfinite(error):
        return f"{value:.6g}"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"
