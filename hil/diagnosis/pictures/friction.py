"""Figure of friction over speed, by direction, on a linear and on a logarithmic speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.pictures import looks
from hil.diagnosis.pictures.fitted_law import FINE, FittedRows, bin_edges, law_at, means
from hil.diagnosis.pictures.view import Captioned, View
from hil.diagnosis.turning import speed_unit
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
from hil.figures.panels import DEVIATION, MEASURED
from hil.identification.estimator import Fit
from hil.identification.terms import Term
from hil.quantities import reading_unit
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage
from hil.twin.picture import Picture

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

BINS = 24
DIRECTIONS = ((1.0, "^", MEASURED, "forwards"), (-1.0, "v", DEVIATION, "backwards"))


def friction_over_speed(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
    """Draw friction against the motion over speed: the fitted law as a curve for each direction, and its points."""
    axis_of = diagnosis.given_bench.axis
    to_read, unit_of_speed = speed_unit(axis_of.turns)
    to_read *= axis_of.ratio_m_rad
    terms = [term for term in diagnosis.final.terms if BY_ID[term.effect].text.picture is Picture.FRICTION]
    figure = Drawing(WIDTH_IN, 5.8)
    (linear, logarithmic), (left, left_log) = figure.subplots(2, 2, height_ratios=(3, 2), sharey="row", sharex="col")
    rows = {sign: [_rows(view, sign) for view in views] for sign, *_ in DIRECTIONS}
    moving = {sign: one for sign, one in rows.items() if any(each.used.any() for each in one)}
    fastest = max(float(each.x[each.used].max()) for one in moving.values() for each in one if each.used.any())
    slowest = min(float(each.x[each.used].min()) for one in moving.values() for each in one if each.used.any())
    factor, unit = reading_unit(
        axis_of.drive_unit, float(friction_law(diagnosis.nominal, (), 1.0, np.array([fastest]))[0])
    )
    for sign, marker, colour, name in DIRECTIONS:
        if sign not in moving:
            continue
        for above, below, log in ((linear, left, False), (logarithmic, left_log, True)):
            edges = bin_edges(moving[sign], BINS)
            fine = np.linspace(0.0, fastest, FINE)
            if log:
                edges, fine = np.geomspace(slowest, fastest, edges.size), np.geomspace(slowest, fastest, FINE)
            found = means(moving[sign], edges)
            points = friction_law(diagnosis.final, terms, sign, found.x) + found.after
            x, error = to_read * found.x, factor * found.error
            looks.points(above, x, factor * points, error, f"measured {name}", colour, marker)
            curve = friction_law(diagnosis.final, terms, sign, fine)
            looks.law(above, to_read * fine, factor * curve, f"{looks.LAW} {name}", colour)
            below.plot(x, factor * found.before, "-", color=colour, linewidth=0.8, alpha=0.6)
            looks.points(below, x, factor * found.after, error, "", colour, marker)
    for axis, fine in ((linear, np.linspace(0.0, fastest, FINE)), (logarithmic, np.geomspace(slowest, fastest, FINE))):
        looks.without(axis, to_read * fine, factor * friction_law(diagnosis.nominal, (), 1.0, fine))
    for axis in (logarithmic, left_log):
        axis.set_xscale("log")
    style_axis(linear, f"friction [{unit}]")
    style_axis(logarithmic, "")
    style_axis(left, f"residual [{unit}]", f"speed of the table [{unit_of_speed}]")
    style_axis(left_log, "", f"speed of the table [{unit_of_speed}], logarithmic")
    for axis in (left, left_log):
        axis.axhline(0.0, color="black", linewidth=0.8)
    legend_outside(figure, (linear,), 3)
    return Captioned(
        figure,
        "Friction over speed: the fitted law as a curve, the law before as a dashed line; each point is the mean of "
        "what was measured of it with two standard errors, all else that the twin knows taken off. Below: what the "
        "twin leaves before (lines) and after (points).",
    )


def friction_law(fit: Fit, terms: Sequence[Term], sign: float, speed: FloatArray) -> FloatArray:
    """Friction (n,) against the motion at speeds (n,) [motor units] in one direction, with the terms of the law."""
    bench, velocity = fit.bench, sign * speed
    physics = bench.axis.physics()
    level, more = np.full(speed.size, physics.coulomb_n_m), physics.viscous_n_m_s_rad * velocity
    for term in terms:
        stage = BY_ID[term.effect].variants[term.variant].stage
        if stage is Stage.COULOMB:
            level = law_at(term, bench, level, velocity=velocity)
        elif stage in (Stage.DRAG, Stage.BIAS):
            more = more + law_at(term, bench, 0.0, velocity=velocity)
        else:  # a torque on the motor
            more = more - law_at(term, bench, 0.0, velocity=velocity)
    return level + sign * more


def _rows(view: View, sign: float) -> FittedRows:
    """Rows that move in one direction; more friction is a torque against the motion."""
    before, after = view.residuals("motor")
    used = view.torque.sliding & (sign * view.torque.velocity > 0.0)
    used[: view.run.evaluated.start] = False
    return FittedRows(np.abs(view.torque.velocity), np.full(before.size, -sign), before, after, used)
