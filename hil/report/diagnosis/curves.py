"""Pictures that show a law as an engineer draws it: friction over speed, lost motion, torque over its command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import savgol_filter

from hil.arrays import FloatArray
from hil.diagnosis.diagnose import Diagnosis
from hil.identification.dataset import Measured, inertia
from hil.identification.estimator import Fit
from hil.report import style
from hil.report.diagnosis.view import AFTER, Shown, View, around, binned, longest
from hil.report.figures import style_axis
from hil.report.style import shown


def friction(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """Motor torque less J a over speed, of the recordings and of the twin run from the same set-points."""
    final = diagnosis.final
    linear, ratio = diagnosis.owner.axis.linear, diagnosis.owner.axis.ratio_m_rad
    fastest = max(float(np.abs(view.torque.velocity).max()) for view in views)
    edges = np.geomspace(1e-3 * fastest, fastest, 45)
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    axis = figure.subplots()
    measured = [_friction_of(final, view.run, view.run.motor, view.run.torque) for view in views]
    answers = [final.hypothesis.respond(view.run) for view in views]
    simulated = [
        _friction_of(final, view.run, answer.motor_position, answer.torque)
        for view, answer in zip(views, answers, strict=True)
    ]
    for sign, marker, name in ((1.0, "^", "positive"), (-1.0, "v", "negative")):
        colour = style.MEASURED if sign > 0.0 else style.DEVIATION
        speed, friction, spread = binned(*_one_way(measured, sign), edges)
        axis.errorbar(
            speed * ratio * 60.0,
            friction,
            spread,
            fmt=marker,
            color=colour,
            markersize=5,
            linewidth=0.8,
            label=f"measured, {name} direction",
        )
        speed, friction, _ = binned(*_one_way(simulated, sign), edges)
        axis.plot(
            speed * ratio * 60.0,
            friction,
            color=AFTER,
            linestyle="-" if sign > 0.0 else "--",
            linewidth=1.8,
            label=f"twin with the terms found, {name}",
        )
    for name, fit, line in (
        ("bench file", diagnosis.explanation.owner, ":"),
        ("nominal twin, refitted", diagnosis.explanation.nominal, "-."),
    ):
        physics = fit.bench.axis.physics()
        axis.plot(
            edges * ratio * 60.0,
            physics.coulomb_n_m + physics.viscous_n_m_s_rad * edges,
            color=style.COMMAND,
            linestyle=line,
            label=name,
        )
    axis.set_xscale("log")
    style_axis(axis, f"friction [{'N' if linear else 'N m'}]")
    axis.set_xlabel("speed of the table [m/min]")
    axis.legend(frameon=False, ncols=2)
    axis.set_title("Friction over speed", loc="left")
    return Shown(
        figure,
        "Motor torque less inertia times acceleration where the axis hardly accelerates: median and "
        "middle half of the samples in each range of speed. The twin with the terms found is run from "
        "the same set-points and treated alike.",
    )


def _friction_of(final: Fit, run: Measured, motor: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed and friction (m,) of the rows at which the axis moves and hardly accelerates."""
    window = max(round(0.021 / run.period_s) | 1, 5)
    velocity = savgol_filter(motor, window, 2, deriv=1, delta=run.period_s)
    inertial = inertia(final.bench) * savgol_filter(motor, window, 2, deriv=2, delta=run.period_s)
    friction = savgol_filter(torque, window, 2) - inertial
    physics = final.bench.axis.physics()
    # the slip of a stick-slip cycle is too short for the differences; at speed, J a is known well
    share = np.where(np.abs(velocity) > 0.05 * np.abs(velocity).max(), 1.0, 0.1)
    rows = (np.abs(inertial) < share * physics.coulomb_n_m) & (np.abs(velocity) > 0.0)
    rows[: run.judged.start + window] = rows[-window:] = False
    return velocity[rows], friction[rows]


def _one_way(found: Sequence[tuple[FloatArray, FloatArray]], sign: float) -> tuple[FloatArray, FloatArray]:
    """Absolute speed and friction against the motion, of one direction."""
    speed = np.concatenate([sign * v for v, _ in found])
    friction = np.concatenate([sign * f for _, f in found])
    return speed[speed > 0.0], friction[speed > 0.0]


def lost_motion(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """Table less motor over the torque, and over time at one reversal."""
    view = longest(views)
    run, ratio = view.run, diagnosis.owner.axis.ratio_m_rad
    stretch = run.table_m - ratio * run.motor
    stretch = stretch - np.mean(stretch)  # the datum of the linear encoder is its own
    nominal, final = diagnosis.explanation.nominal, diagnosis.final
    lines = (
        ("measured", stretch, style.MEASURED),
        ("nominal twin, refitted", stretch - diagnosis.residuals(nominal, run)["table"], style.COMMAND),
        ("twin with the terms found", stretch - diagnosis.residuals(final, run)["table"], AFTER),
    )
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    acceleration = savgol_filter(run.table_m, max(round(0.009 / run.period_s) | 1, 5), 2, deriv=2, delta=run.period_s)
    rows = np.arange(run.judged.start, stretch.size, max(stretch.size // 8000, 1))
    unit = shown("m", float(np.abs(stretch).max()))
    for label, values, colour in (lines[1], lines[0], lines[2]):
        broad = label == "measured"
        left.plot(
            acceleration[rows],
            values[rows] * unit.factor,
            ".",
            color=colour,
            markersize=5.0 if broad else 1.5,
            alpha=0.4 if broad else 0.8,
            label=label,
            rasterized=True,
            markeredgewidth=0.0,
        )
    style_axis(left, f"table less motor position [{unit.unit}]")
    left.set_xlabel("acceleration of the table [m/s²]: load of the transmission")
    left.set_title("Over the load", loc="left")
    left.legend(frameon=False, markerscale=3.0)
    window = _reversal(run)
    time = run.time_s[window]
    for label, values, colour in lines:
        broad = label == "measured"
        right.plot(
            time,
            values[window] * unit.factor,
            color=colour,
            label=label,
            linewidth=2.6 if broad else 1.1,
            alpha=0.5 if broad else 1.0,
        )
    style_axis(right, f"table less motor position [{unit.unit}]")
    right.set_xlabel("time [s]")
    right.set_title("At one reversal", loc="left")
    return Shown(
        figure,
        "Table against motor: compliance is a slope over the load, lost motion a step where the load "
        "changes its direction, however small it is.",
    )


def drive(diagnosis: Diagnosis, views: Sequence[View]) -> Shown:
    """Torque over its command: measured and both twins."""
    view = longest(views)
    run, nominal, final = view.run, diagnosis.explanation.nominal, diagnosis.final
    rows = np.arange(run.judged.start, run.motor.size, max(run.motor.size // 8000, 1))
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    unit = "N" if diagnosis.owner.axis.linear else "N m"
    window = _steepest(run.torque_command, run)
    for label, values, colour in (
        ("nominal twin, refitted", run.torque - diagnosis.residuals(nominal, run)["torque"], style.COMMAND),
        ("measured", run.torque, style.MEASURED),
        ("twin with the terms found", run.torque - diagnosis.residuals(final, run)["torque"], AFTER),
    ):
        broad = label == "measured"
        left.plot(
            run.torque_command[rows],
            values[rows],
            ".",
            color=colour,
            markersize=6.0 if broad else 2.0,
            alpha=0.5,
            markeredgewidth=0.0,
            label=label,
        )
        right.plot(
            run.time_s[window],
            values[window],
            color=colour,
            linewidth=3.0 if broad else 1.2,
            alpha=0.5 if broad else 1.0,
        )
    right.plot(
        run.time_s[window], run.torque_command[window], color="black", linewidth=0.8, linestyle=":", label="command"
    )
    style_axis(left, f"torque [{unit}]")
    left.set_xlabel(f"torque command [{unit}]")
    left.legend(frameon=False, markerscale=2.0)
    left.set_title("Over the command", loc="left")
    style_axis(right, f"torque [{unit}]")
    right.set_xlabel("time [s]")
    right.legend(frameon=False)
    right.set_title("Where the command changes fastest", loc="left")
    return Shown(figure, "Torque against its command, measured and as the twin has it before and after.")


def _reversal(run: Measured) -> slice:
    """Rows about a reversal of the set-points in the middle of the recording."""
    moving = np.flatnonzero(np.abs(run.velocity_command_m_s) > 1e-3 * np.abs(run.velocity_command_m_s).max())
    turns = moving[1:][np.diff(np.sign(run.velocity_command_m_s[moving])) != 0.0]
    row = int(turns[turns.size // 2]) if turns.size else run.motor.size // 2
    return around(row, run, 0.4)


def _steepest(values: FloatArray, run: Measured) -> slice:
    rows = np.convolve(np.abs(np.diff(values)), np.ones(20), "same")
    return around(int(np.argmax(rows[run.judged])) + run.judged.start, run, 0.05)
