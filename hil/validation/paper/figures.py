"""Pictures of the reproduction: modes, frequency responses, moves. Each returns a matplotlib figure."""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from hil.arrays import FloatArray
from hil.motion.pieces import Motion
from hil.motion.trajectory import Trajectory
from hil.twin.structure import frequency
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, seven_dof
from hil.twin.structure.modal import modal
from hil.validation.paper import source
from hil.validation.paper.tables import bandwidth_hz

COMMAND, TWO, SEVEN, AXIAL = "#444444", "#d55e00", "#0072b2", "#009e73"  # told apart by the colour-blind
_MODEL_STYLE = {"2-dof": {"color": TWO, "linestyle": "--"}, "7-dof": {"color": SEVEN, "linestyle": "-"}}


def mode_shapes() -> Figure:
    """Draw the first three modes of the 7-dof model (Fig. 6), each to its largest component."""
    chain = source.chains()["7-dof"]
    modes = modal(chain)
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True, sharey=True)
    labels = [f"$\\theta_{{{i + 1}}}$\n" + name.replace(", ", ",\n") for i, name in enumerate(chain.names)]
    colours = [SEVEN] * 4 + [AXIAL] * 3
    for i, axis in enumerate(axes):
        shape = modes.shape[:, i] / modes.shape[np.argmax(np.abs(modes.shape[:, i])), i]
        axis.bar(labels, shape, color=colours, width=0.6)
        axis.axhline(0.0, color="black", linewidth=0.8)
        hz = modes.frequency_rad_s[i] / (2.0 * pi)
        axis.set_title(f"Mode {i + 1}: {'rigid body, 0' if i == 0 else f'{hz:.1f}'} Hz", loc="left")
        axis.set_ylabel("amplitude / largest")
        axis.grid(axis="y", alpha=0.3)
    axes[0].bar([0], [0], color=SEVEN, label="turning")
    axes[0].bar([0], [0], color=AXIAL, label="axial, as motor angle")
    axes[0].legend(loc="lower left", ncols=2)
    axes[0].set_ylim(-1.15, 1.15)
    return figure


def bode_transfer(number: int) -> Figure:
    """Draw the Bode diagram of TF1 or TF2 for the 2- and the 7-dof model (Fig. 9 a, b)."""
    frequency_hz = np.geomspace(1.0, 10_000.0, 6000)
    figure, magnitude, phase = _bode_axes()
    for name, chain in source.chains().items():
        response = frequency.modal_transfer(modal(chain), frequency_hz)[number - 1]
        _bode(magnitude, phase, frequency_hz, response, label=name, **_MODEL_STYLE[name])
        for hz in modal(chain).frequency_rad_s[1:] / (2.0 * pi):
            magnitude.axvline(hz, color=_MODEL_STYLE[name]["color"], linewidth=0.6, alpha=0.4)
    quantity, unit = (("motor angle / torque", "dB re 1 rad/(N m)"), ("table / motor", "dB"))[number - 1]
    phase.yaxis.set_major_locator(MultipleLocator((45.0, 180.0)[number - 1]))
    phase.set_ylim(top=10.0)
    magnitude.set_title(f"TF$_{number}$: {quantity}; thin lines: eigenfrequencies", loc="left")
    magnitude.set_ylabel(f"magnitude [{unit}]")
    magnitude.legend()
    return figure


def bode_closed_loop() -> Figure:
    """Draw position command to table, without and with feed-forward, for both models (Fig. 9 c)."""
    frequency_hz = np.geomspace(0.1, 1000.0, 6000)
    figure, magnitude, phase = _bode_axes()
    for name, chain in source.chains().items():
        for feedforward, width in ((0.0, 2.0), (1.0, 1.0)):
            law = source.gains(feedforward)
            response = frequency.closed_loop(modal(chain), law, frequency_hz)
            label = f"{name}, feed-forward {feedforward:.0%}: -3 dB at {bandwidth_hz(name, feedforward):.1f} Hz"
            _bode(magnitude, phase, frequency_hz, response, label=label, linewidth=width, **_MODEL_STYLE[name])
    magnitude.axhline(-3.0, color="black", linewidth=0.8, linestyle=":")
    magnitude.axvline(2.32, color="black", linewidth=0.8, linestyle=":")
    magnitude.annotate("2.32 Hz printed", (2.32, -22.0), xytext=(-4, 0), textcoords="offset points", ha="right")
    magnitude.annotate("-3 dB", (0.1, -3.0), xytext=(0, -3), textcoords="offset points", va="top")
    phase.yaxis.set_major_locator(MultipleLocator(90.0))
    magnitude.set_title("Closed loop: table position / position command (continuous loops)", loc="left")
    magnitude.set_ylabel("magnitude [dB]")
    magnitude.set_ylim(-80.0, 15.0)
    magnitude.legend(loc="lower left")
    return figure


def _bode_axes() -> tuple[Figure, Axes, Axes]:
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    magnitude, phase = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    phase.set_xlabel("frequency [Hz]")
    phase.set_ylabel("phase [deg]")
    for axis in (magnitude, phase):
        axis.set_xscale("log")
        axis.grid(which="major", alpha=0.4)
        axis.grid(which="minor", alpha=0.15)
    return figure, magnitude, phase


def _bode(
    magnitude: Axes, phase: Axes, frequency_hz: FloatArray, response: frequency.ComplexArray, **style: Any
) -> None:
    magnitude.plot(frequency_hz, 20.0 * np.log10(np.abs(response)), **style)
    degrees = np.degrees(np.unwrap(np.angle(response)))
    # unwrapping leaves the start free by whole turns: start in (-360, 0]
    degrees -= 360.0 * np.ceil(np.round(degrees[0]) / 360.0)
    phase.plot(frequency_hz, degrees, **style)


def move_over_time(runs: Sequence[tuple[str, source.SimulatedMove]]) -> Figure:
    """Draw position, following error, velocity, acceleration, jerk and torque of one move (Fig. 7, 8, 10)."""
    figure = Figure(figsize=(9.0, 12.0), layout="constrained")
    axes = figure.subplots(6, 1, sharex=True)
    first = runs[0][1]
    for axis, values in zip(axes[[0, 2, 3, 4]], _kinematics(first.command), strict=True):
        axis.plot(first.command.time_s, values, color=COMMAND, linewidth=0.9, label="command", zorder=3)
    for name, run in runs:
        style = _MODEL_STYLE[name] | {"linewidth": 1.2}
        position, velocity, acceleration, jerk = _kinematics(run.table)
        signals = (position, run.following_error_m * 1e6, velocity, acceleration, jerk, run.response.torque)
        for axis, values in zip(axes, signals, strict=True):
            axis.plot(run.command.time_s, values, label=f"{name}, table" if axis is axes[0] else None, **style)
    for axis, label in zip(
        axes,
        (
            "position [mm]",
            "following error [µm]",
            "velocity [m/min]",
            "acceleration [m/s²]",
            "jerk [m/s³]",
            "motor torque [N m]",
        ),
        strict=True,
    ):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    peak_m_min = float(np.max(first.command.velocity_m_s)) * 60.0
    lowered = f" (lowered to {peak_m_min:.1f} m/min by the acceleration limit)" if first.command.notes else ""
    axes[0].set_title(f"100 mm at {first.feed_m_min:g} m/min{lowered}", loc="left")
    axes[0].legend(loc="upper left")
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(first.command.time_s[0], first.command.time_s[-1])
    figure.align_ylabels(axes)
    return figure


def _kinematics(motion: Motion | Trajectory) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    return (motion.position_m * 1e3, motion.velocity_m_s * 60.0, motion.acceleration_m_s2, motion.jerk_m_s3)


def nut_travel() -> Figure:
    """Draw stiffness of the screw (Eq. 18 and G J / L) and frequencies of the 7-dof model over the nut's travel."""
    nut_m = np.linspace(0.0, 0.4, 81)
    p = RECONSTRUCTED_TABLE_1
    hz = np.array([modal(seven_dof(p, source.DAMPING_RATIO, x)).frequency_rad_s / (2.0 * pi) for x in nut_m])
    torsion = np.array([p.screw_torsion_n_m_rad(x) for x in nut_m]) / p.screw_torsion_n_m_rad()
    axial = np.array([p.screw_axial_n_m(x) for x in nut_m]) / p.screw_axial_n_m()
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    stiffness, frequencies = figure.subplots(2, 1, sharex=True, height_ratios=(2, 3))
    stiffness.plot(nut_m * 1e3, torsion, color=SEVEN, label="torsional, $k_{t3}$")
    stiffness.plot(nut_m * 1e3, axial, color=AXIAL, label="axial, $k_{a4}$")
    stiffness.set_ylabel("stiffness / at 200 mm")
    stiffness.set_title("Screw stiffness and eigenfrequencies over the travel of the nut (7-dof)", loc="left")
    stiffness.legend()
    for mode in range(1, 7):
        frequencies.plot(nut_m * 1e3, hz[:, mode], color=SEVEN)
        frequencies.annotate(
            f"mode {mode + 1}", (400.0, hz[-1, mode]), xytext=(4, 0), textcoords="offset points", va="center"
        )
    frequencies.set_ylabel("frequency [Hz]")
    frequencies.set_xlabel("nut position [mm]")
    frequencies.set_xlim(0.0, 440.0)
    for axis, ticks in ((stiffness, (0.5, 1, 2, 5, 10, 20)), (frequencies, (100, 200, 500, 1000, 2000, 5000, 10000))):
        axis.set_yscale("log")
        axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.axvline(200.0, color="black", linewidth=0.8, linestyle=":")
        axis.grid(which="both", alpha=0.25)
    return figure
