"""Figures of a hysteresis: lost motion and friction over the position about a reversal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hil.arrays import FloatArray
from hil.diagnosis.pictures import looks
from hil.diagnosis.pictures.fitted_law import FINE, FittedRows, law_at, means
from hil.diagnosis.pictures.view import Captioned, View, longest, noise, unit_of_channel
from hil.diagnosis.search.disturbance import smooth
from hil.diagnosis.turning import speed_unit
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
from hil.figures.panels import DEVIATION
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.quantities import reading_unit
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

POINTS, ROWS_PER_POINT = 80, 8  # of a loop: a curve between its points shows its corners
BINS = 30
WAYS = 12.0  # travel on either side of a reversal, over the width of the hysteresis
LEAST_WAY_M = 20e-6
LONGEST_S = 1.0


class LoopSignals(NamedTuple):
    """Rows of one run about a reversal, and a signal (n,) there: measured, of the twins before and after."""

    rows: slice
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    resolution: float = 0.0  # of the encoder: at rest its count does not change


def lost_motion(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw table - motor position about a reversal as a loop, and over the load of the transmission or the speed."""
    view = longest(views)
    ratio, run = diagnosis.given_bench.axis.ratio_m_rad, view.run
    stretch = run.table_m - ratio * run.motor
    before, after = view.residuals("table")
    zero = float(np.mean((stretch - after)[run.evaluated]))  # the zero of the second encoder is arbitrary
    stretch = stretch - zero
    width = float(np.ptp(np.percentile((stretch - after)[run.evaluated], (2.0, 98.0))))
    loop = LoopSignals(reversal(diagnosis, run, width), stretch, stretch - before, stretch - after, noise(run, "table"))
    figure = Drawing(WIDTH_IN, 4.4)
    left, right = figure.subplots(1, 2)
    unit = unit_of_channel(diagnosis, "table")
    _loop(left, diagnosis, view, loop, "table - motor position", unit)
    shown = BY_ID[view.term.effect].variants[view.term.variant].stage is Stage.TRANSMISSION
    (_over_load if shown else _over_speed)(right, diagnosis, views, unit)
    legend_outside(figure, (left, right), 5)
    over = "the load, given as the deflection that it would make without it" if shown else "the speed of the table"
    return Captioned(
        figure,
        "Table against motor at a reversal: the loop that the twin draws and the measured points, two standard errors. "
        f"Right: over {over}.",
    )


def friction_loop(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw friction over the motor position about a reversal as a loop, and over time."""
    view, bench = longest(views), diagnosis.final.bench
    run = view.run
    acceleration = np.gradient(view.torque.velocity, run.period_s)
    friction = smooth(run.torque, run.period_s) - inertia(bench) * acceleration
    before, after = view.residuals("motor")
    way = bench.axis.physics().coulomb_n_m / max(view.term.values[0], 1e-300) * bench.axis.ratio_m_rad
    rows = reversal(diagnosis, run, way)
    loop = LoopSignals(rows, friction, friction + before, friction + after)
    figure = Drawing(WIDTH_IN, 4.4)
    left, right = figure.subplots(1, 2)
    unit = bench.axis.drive_unit
    _loop(left, diagnosis, view, loop, "friction", unit)
    factor, name = reading_unit(unit, float(np.abs(loop.after[rows]).max()))
    looks.trace(right, run.time_s[rows], factor * loop.measured[rows])
    looks.twin(right, run.time_s[rows], factor * loop.before[rows], "before")
    looks.twin(right, run.time_s[rows], factor * loop.after[rows], "after")
    style_axis(right, f"friction [{name}]", "time [s]")
    legend_outside(figure, (left,))
    return Captioned(
        figure,
        "Friction (torque less inertia × acceleration) at a reversal, over the position and over time: measured points "
        "with two standard errors, and the twins before and after.",
    )


def reversal(diagnosis: Diagnosis, run: Measured, width_m: float) -> slice:
    """Rows about the slowest reversal, as far as the table goes some widths of a hysteresis on either side."""
    position = diagnosis.given_bench.axis.ratio_m_rad * run.motor
    moving = np.flatnonzero(np.abs(run.velocity_command_m_s) > 1e-3 * np.abs(run.velocity_command_m_s).max())
    moving = moving[moving >= run.evaluated.start]
    turns = moving[1:][np.diff(np.sign(run.velocity_command_m_s[moving])) != 0.0]
    way, most = max(WAYS * width_m, LEAST_WAY_M), round(LONGEST_S / run.period_s)
    best, least = slice(run.evaluated.start, run.motor.size), np.inf
    for turn in turns:
        first, last = max(int(turn) - most, run.evaluated.start), min(int(turn) + most, run.motor.size)
        off = np.abs(position[first:last] - position[turn]) > way
        before, after = np.flatnonzero(off[: turn - first]), np.flatnonzero(off[turn - first :])
        first, last = (
            (first + int(before[-1]) if before.size else first),
            (int(turn) + int(after[0]) if after.size else last),
        )
        speed = float(np.abs(run.velocity_command_m_s[first:last]).max())
        if speed < least:
            best, least = slice(first, last), speed
    return best


def _loop(axis: Axes, diagnosis: Diagnosis, view: View, loop: LoopSignals, label: str, unit: str) -> None:
    """Draw a loop over the position: the twins as curves, the measurement as means along the way."""
    run, rows = view.run, loop.rows
    position = diagnosis.given_bench.axis.ratio_m_rad * run.motor
    position = position - float(position[rows].min())
    used, row, one = (
        np.zeros(run.motor.size, dtype=bool),
        np.arange(run.motor.size, dtype=float),
        np.ones(run.motor.size),
    )
    used[rows] = True
    count = int(np.clip((rows.stop - rows.start) // ROWS_PER_POINT, 4, POINTS))
    edges = np.linspace(float(row[rows][0]), float(row[rows][-1]), count + 1)
    found = means([FittedRows(row, one, loop.before, loop.measured - loop.after, used, loop.resolution)], edges)
    middle = np.round(found.x).astype(int)
    points = loop.after[middle] + found.after
    along, x_unit = reading_unit("rad" if diagnosis.given_bench.axis.turns else "m", float(position[rows].max()))
    factor, name = reading_unit(unit, float(np.abs(loop.after[rows]).max()))
    looks.twin(axis, along * position[rows], factor * loop.before[rows], "before")
    looks.twin(axis, along * position[rows], factor * loop.after[rows], "after")
    looks.points(axis, along * position[middle], factor * points, factor * found.error)
    style_axis(axis, f"{label} [{name}]", f"motor position [{x_unit}]")


def _over_load(axis: Axes, diagnosis: Diagnosis, views: Sequence[View], unit: str) -> None:
    """Draw the law of the transmission: deflection over the load."""
    ratio, term = diagnosis.given_bench.axis.ratio_m_rad, views[0].term
    deflections, rows = [], []
    for view in views:
        _, after = view.residuals("table")
        run = view.run
        twin = run.table_m - ratio * run.motor - after
        twin = twin - float(np.mean(twin[run.evaluated]))
        used = np.zeros(twin.size, dtype=bool)
        used[run.evaluated] = True
        load = -ratio * law_at(term, diagnosis.final.bench, -twin / ratio)
        deflections.append(float(np.abs(twin[run.evaluated]).max()))
        rows.append(FittedRows(load, np.ones(twin.size), twin + after, after, used))
    fine = np.linspace(-1.0, 1.0, FINE) * max(deflections)
    load = -ratio * law_at(term, diagnosis.final.bench, -fine / ratio)
    found = means(rows, np.linspace(float(load.min()), float(load.max()), BINS + 1))
    factor, name = reading_unit(unit, max(deflections))
    looks.without(axis, factor * load, factor * load)
    looks.law(axis, factor * load, factor * fine)
    looks.points(axis, factor * found.x, factor * found.before, factor * found.error)
    style_axis(axis, f"table - motor position [{name}]", f"load, as deflection [{name}]")


def _over_speed(axis: Axes, diagnosis: Diagnosis, views: Sequence[View], unit: str) -> None:
    """Draw the deflection over the speed of the table, whose friction makes it."""
    axis_of = diagnosis.given_bench.axis
    ratio, (to_read, unit_of_speed) = axis_of.ratio_m_rad, speed_unit(axis_of.turns)
    rows: dict[str, list[FittedRows]] = {"measured": [], "before": [], "after": []}
    for view in views:
        before, after = view.residuals("table")
        stretch = view.run.table_m - ratio * view.run.motor
        stretch = stretch - float(np.mean((stretch - after)[view.run.evaluated]))
        one, used = np.ones(stretch.size), np.zeros(stretch.size, dtype=bool)
        used[view.run.evaluated] = view.torque.sliding[view.run.evaluated]
        speed = ratio * view.torque.velocity
        for name, values in (("measured", stretch), ("before", stretch - before), ("after", stretch - after)):
            rows[name].append(FittedRows(speed, one, values, after, used))
    x = np.concatenate([one.x[one.used] for one in rows["measured"]])
    edges = np.linspace(float(x.min()), float(x.max()), BINS + 1)
    found = {name: means(each, edges) for name, each in rows.items()}
    factor, name = reading_unit(unit, float(np.abs(found["measured"].before).max()))
    looks.twin(axis, to_read * found["before"].x, factor * found["before"].before, "before")
    looks.twin(axis, to_read * found["after"].x, factor * found["after"].before, "after")
    measured = found["measured"]
    looks.points(axis, to_read * measured.x, factor * measured.before, factor * measured.error)
    axis.axvline(0.0, color=DEVIATION, linewidth=0.8, linestyle=":")
    style_axis(axis, f"table - motor position [{name}]", f"speed of the table [{unit_of_speed}]")
