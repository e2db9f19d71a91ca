"""Figures of physical laws: friction over speed, lost motion over load, torque over its command."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.diagnosis.pictures.view import Captioned, Curve, View, around, binned, longest, three_curves, unit_of_channel
from hil.diagnosis.turning import speed_unit
from hil.figures.drawing import style_axis
from hil.figures.panels import COMMAND, DEVIATION, MEASURED, SIMULATED
from hil.identification.derivatives import motion, smoothed, window_rows
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.quantities import reading_unit

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

CLOUD_POINTS = 8000  # of a scatter plot: more points overlap
REVERSAL_S, STEEPEST_S = 0.4, 0.05  # shown before and after: a reversal with its ramps, a step of the current loop


def friction_over_speed(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw motor torque - J a over speed, measured and of the twin, beside the friction laws."""
    final = diagnosis.final
    factor, unit_of_speed = speed_unit(diagnosis.given_bench.axis.turns)
    to_read = factor * diagnosis.given_bench.axis.ratio_m_rad
    fastest = max(float(np.abs(view.torque.velocity).max()) for view in views)
    edges = np.geomspace(1e-3 * fastest, fastest, 45)
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    axis = figure.subplots()
    measured = [_friction_of(final, view.run, view.run.motor, view.run.torque) for view in views]
    simulated = [_friction_of(final, view.run, *_answer(final, view)) for view in views]
    for sign, marker, colour, dash, name in (
        (1.0, "^", MEASURED, "-", "positive"),
        (-1.0, "v", DEVIATION, "--", "negative"),
    ):
        speed, friction, spread = binned(*_one_direction(measured, sign), edges)
        label = f"measured, {name} direction"
        axis.errorbar(
            speed * to_read, friction, spread, fmt=marker, color=colour, markersize=5, linewidth=0.8, label=label
        )
        speed, friction, _ = binned(*_one_direction(simulated, sign), edges)
        label = f"twin with the findings, {name}"
        axis.plot(speed * to_read, friction, color=SIMULATED, marker=".", linestyle=dash, linewidth=1.8, label=label)
    for name, fit, dash in (
        ("bench file", diagnosis.searched.given, ":"),
        ("nominal twin, refitted", diagnosis.nominal, "-."),
    ):
        physics = fit.bench.axis.physics()
        law = physics.coulomb_n_m + physics.viscous_n_m_s_rad * edges
        axis.plot(edges * to_read, law, color=COMMAND, linestyle=dash, label=name)
    axis.set_xscale("log")
    unit = "N" if diagnosis.given_bench.axis.linear else "N m"
    style_axis(axis, f"friction [{unit}]", f"speed of the table [{unit_of_speed}]", "Friction over speed")
    axis.legend(frameon=False, ncols=2)
    how = (
        "simulated from the same set-points" if final.data.observability.closed_loop else "held on the measured motion"
    )
    return Captioned(
        figure,
        "Motor torque - inertia × acceleration where the acceleration is small: median and quartiles of the samples in "
        f"each range of speed. The twin with the findings is {how} and evaluated alike.",
    )


def _answer(final: Fit, view: View) -> tuple[FloatArray, FloatArray]:
    """Motor position and torque (n,) of the twin: in closed loop, else that of the measured motion.

    Without a control law the torque is the measured one with the disturbance that the twin lacks.
    """
    if not final.data.observability.closed_loop:
        return view.run.motor, view.run.torque + view.torque.torque - view.torque_modelled.torque
    response = final.hypothesis.respond(view.run)
    return response.motor_position, response.torque


def _friction_of(final: Fit, run: Measured, motor: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed and friction (m,) of the rows in which the axis moves with little acceleration."""
    moved, window = motion(motor, run.period_s), window_rows(run.period_s)
    velocity, inertial = moved.velocity, inertia(final.bench) * moved.acceleration
    friction = smoothed(torque, run.period_s) - inertial
    coulomb = final.bench.axis.physics().coulomb_n_m
    # the slip of a stick-slip cycle is shorter than the filter window; at higher speed J a is known well
    share = np.where(np.abs(velocity) > 0.05 * np.abs(velocity).max(), 1.0, 0.1)
    rows = (np.abs(inertial) < share * coulomb) & (np.abs(velocity) > 0.0)
    rows[: run.evaluated.start + window] = rows[-window:] = False
    return velocity[rows], friction[rows]


def _one_direction(found: Sequence[tuple[FloatArray, FloatArray]], sign: float) -> tuple[FloatArray, FloatArray]:
    """Absolute speed and friction against the motion, of one direction."""
    speed, friction = (sign * np.concatenate(column) for column in zip(*found, strict=True))
    return speed[speed > 0.0], friction[speed > 0.0]


def lost_motion(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw table - motor position over the acceleration and, at one reversal, over time."""
    run = longest(views).run
    stretch = run.table_m - diagnosis.given_bench.axis.ratio_m_rad * run.motor
    stretch = stretch - np.mean(stretch)  # the zero of the linear encoder is arbitrary
    factor, unit = reading_unit(unit_of_channel(diagnosis, "table"), float(np.abs(stretch).max()))
    curves = three_curves(diagnosis, run, "table", stretch)
    acceleration = motion(run.table_m, run.period_s, smooth_s=0.009).acceleration
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    label = f"table - motor position [{unit}]"
    _cloud(left, acceleration, curves, run, factor)
    style_axis(left, label, "acceleration of the table [m/s²]: load of the transmission", "Over the load")
    _traces(right, curves, run, _reversal(run), factor)
    style_axis(right, label, "time [s]", "At one reversal")
    return Captioned(
        figure,
        "Table against motor: compliance shows as a slope over the load, lost motion as a step at the change of sign "
        "of the load, independent of its magnitude.",
    )


def torque_over_command(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw torque over its command and over time, measured and of both twins."""
    run = longest(views).run
    curves = three_curves(diagnosis, run, "torque", run.torque)
    unit = "N" if diagnosis.given_bench.axis.linear else "N m"
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    _cloud(left, run.torque_command, curves, run)
    style_axis(left, f"torque [{unit}]", f"torque command [{unit}]", "Over the command")
    window = _steepest(run.torque_command, run)
    _traces(right, curves, run, window)
    time_s = run.time_s[window]
    right.plot(time_s, run.torque_command[window], color="black", linewidth=0.8, linestyle=":", label="command")
    right.legend(frameon=False)
    style_axis(right, f"torque [{unit}]", "time [s]", "At the fastest change of the command")
    return Captioned(figure, "Torque against its command: measured, refitted nominal twin, and twin with the findings.")


def _cloud(axis: Axes, x: FloatArray, curves: Sequence[Curve], run: Measured, factor: float = 1.0) -> None:
    """Scatter the judged rows of curves over x; the measured points are large and pale."""
    rows = np.arange(run.evaluated.start, x.size, max(x.size // CLOUD_POINTS, 1))
    for curve in curves:
        size, alpha = (5.0, 0.4) if curve.label == "measured" else (1.5, 0.8)
        axis.plot(
            x[rows],
            curve.values[rows] * factor,
            ".",
            color=curve.colour,
            markersize=size,
            alpha=alpha,
            markeredgewidth=0.0,
            label=curve.label,
            rasterized=True,
        )
    axis.legend(frameon=False, markerscale=3.0)


def _traces(axis: Axes, curves: Sequence[Curve], run: Measured, rows: slice, factor: float = 1.0) -> None:
    """Draw rows of curves over time; the measured one is wide and pale."""
    for curve in curves:
        width, alpha = (2.8, 0.5) if curve.label == "measured" else (1.2, 1.0)
        values = curve.values[rows] * factor
        axis.plot(run.time_s[rows], values, color=curve.colour, linewidth=width, alpha=alpha, label=curve.label)


def _reversal(run: Measured) -> slice:
    """Rows about a reversal of the set-points in the middle of the recording."""
    moving = np.flatnonzero(np.abs(run.velocity_command_m_s) > 1e-3 * np.abs(run.velocity_command_m_s).max())
    turns = moving[1:][np.diff(np.sign(run.velocity_command_m_s[moving])) != 0.0]
    row = int(turns[turns.size // 2]) if turns.size else run.motor.size // 2
    return around(row, run, REVERSAL_S)


def _steepest(values: FloatArray, run: Measured) -> slice:
    """Rows about the fastest change of a signal (n,)."""
    rows = np.convolve(np.abs(np.diff(values)), np.ones(20), "same")
    return around(int(np.argmax(rows[run.evaluated])) + run.evaluated.start, run, STEEPEST_S)
