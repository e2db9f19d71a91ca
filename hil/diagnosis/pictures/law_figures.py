"""Figures of a law over one quantity: the curve through its points, and the residual before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from hil.arrays import FloatArray
from hil.diagnosis.pictures import looks
from hil.diagnosis.pictures.fitted_law import FINE, FittedRows, Means, bin_edges, means
from hil.diagnosis.pictures.laws import DrawnLaw, of_axis
from hil.diagnosis.pictures.over_time import residual_over_time
from hil.diagnosis.pictures.view import Captioned, Drawer, View
from hil.figures.drawing import WIDTH_IN, Drawing, legend_outside, style_axis
from hil.figures.panels import COMMAND, DEVIATION, MEASURED
from hil.quantities import digits, reading_unit

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

BINS, BINS_OF_PERIOD = 40, 24
ORDERS = 1500  # of a spectrum
SPECTRUM_ROWS = 20_000


def law_picture(of_any: DrawnLaw) -> Drawer:
    """Make the picture of a law: folded on its period beside the spectrum, or over the whole quantity."""

    def picture(diagnosis: Diagnosis, views: Sequence[View]) -> Captioned:
        law = of_axis(of_any, diagnosis)
        if any(law.channel(view) not in view.before for view in views):
            return residual_over_time(diagnosis, views)
        period = law.period(views[0].term)
        rows = [law.rows(diagnosis, view) for view in views]
        if period is None:
            return _over_all(law, diagnosis, views, rows)
        return _folded(law, diagnosis, views, rows, period)

    return picture


def _over_all(law: DrawnLaw, diagnosis: Diagnosis, views: Sequence[View], rows: Sequence[FittedRows]) -> Captioned:
    """Draw the law over the whole quantity; below, the residual before and after."""
    term, (label, unit) = views[0].term, law.labelled(diagnosis, views[0])
    edges = bin_edges(rows, BINS)
    found, fine = means(rows, edges), np.linspace(edges[0], edges[-1], FINE)
    figure = Drawing(WIDTH_IN, 5.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    along, x_unit = reading_unit(law.over.unit(diagnosis), float(np.abs(edges).max()))
    curve, at_points = law.value(term, diagnosis, fine), law.value(term, diagnosis, found.x)
    if np.any(law.bare(fine)):
        factor = reading_unit(unit, float(np.abs(curve).max())).factor
        looks.without(above, along * fine, factor * law.bare(fine))
    _law(above, along * fine, curve, along * found.x, at_points + found.after, found.error, unit, label)
    _left(below, along, found, unit)
    below.set_xlabel(f"{law.over.label} [{x_unit}]")
    legend_outside(figure, (above, below), 5)
    return Captioned(
        figure,
        f"{_capital(label)} over {law.over.label}: the fitted law as a curve; each point is the mean of what was "
        "measured of it, all else that the twin knows taken off. Below: what the twin leaves without it and with it.",
    )


def _folded(
    law: DrawnLaw, diagnosis: Diagnosis, views: Sequence[View], rows: Sequence[FittedRows], period: float
) -> Captioned:
    """Draw the law within one period beside the spectrum over the order."""
    term, (label, unit) = views[0].term, law.labelled(diagnosis, views[0])
    folded = [
        FittedRows(np.mod(one.x, period), one.carrier, one.before, one.after, one.used, one.resolution) for one in rows
    ]
    found = means(folded, np.linspace(0.0, period, BINS_OF_PERIOD + 1))
    fine = np.linspace(0.0, period, FINE)
    figure = Drawing(WIDTH_IN, 6.2)
    mosaic = figure.subplot_mosaic([["law", "spectrum"], ["left", "spectrum"]], height_ratios=(3, 2))
    above, below, beside = mosaic["law"], mosaic["left"], mosaic["spectrum"]
    along, x_unit = reading_unit(law.over.unit(diagnosis), period)
    if x_unit == "rad" or x_unit == "mrad":
        along, x_unit = 180.0 / np.pi, "°"
    curve, at_points = law.value(term, diagnosis, fine), law.value(term, diagnosis, found.x)
    _law(above, along * fine, curve, along * found.x, at_points + found.after, found.error, unit, label)
    _left(below, along, found, unit)
    below.set_xlabel(f"{law.over.label} within one period [{x_unit}]")
    below.sharex(above)
    _spectrum(beside, law, rows, period, unit)
    legend_outside(figure, (above, beside), 5)
    return Captioned(
        figure,
        f"{_capital(label)} folded on one period of {digits(along * period)} {x_unit}: the fitted law as a curve; each "
        "point is the mean of what was measured of it, all else that the twin knows taken off. Below: what the twin "
        "leaves without it and with it. Right: amplitude of what it leaves over the order.",
    )


def _law(
    axis: Axes,
    x: FloatArray,
    curve: FloatArray,
    at: FloatArray,
    points: FloatArray,
    error: FloatArray,
    unit: str,
    label: str,
) -> None:
    factor, name = reading_unit(unit, float(np.abs(curve).max()))
    looks.points(axis, at, factor * points, factor * error)
    looks.law(axis, x, factor * curve)
    style_axis(axis, f"{label}\n[{name}]")


def _left(axis: Axes, along: float, found: Means, unit: str) -> None:
    factor, name = reading_unit(unit, float(np.abs(found.before).max()))
    axis.axhline(0.0, color="black", linewidth=0.8)
    axis.plot(
        along * found.x,
        factor * found.before,
        "o-",
        color=COMMAND,
        markersize=3,
        linewidth=0.8,
        label="residual before",
    )
    looks.points(axis, along * found.x, factor * found.after, factor * found.error)
    style_axis(axis, f"residual\n[{name}]")


def _spectrum(axis: Axes, law: DrawnLaw, rows: Sequence[FittedRows], period: float, unit: str) -> None:
    """Draw the amplitude of the residual over the order, before and after."""
    order = law.over.per_unit / period
    orders, before, after = spectra(law, rows, order)
    factor, name = reading_unit(unit, float(before.max()))
    axis.fill_between(orders, 0.0, factor * before, color=COMMAND, alpha=0.45, linewidth=0.0, label="residual before")
    axis.plot(orders, factor * after, color=MEASURED, linewidth=1.0, label="residual after")
    axis.set_xlim(orders[0], orders[-1])
    axis.set_ylim(0.0, None)
    axis.axvline(order, color=DEVIATION, linewidth=1.0, linestyle=":")
    label = law.over.per if "[" in law.over.per else f"cycles {law.over.per}"
    style_axis(axis, f"amplitude of the residual [{name}]", label)


def spectra(law: DrawnLaw, rows: Sequence[FittedRows], order: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Orders (m,) and amplitudes (m,) of the residuals there before and after, by regression on the carrier."""
    turns, carrier, before, after = (
        [values[one.used] for values, one in zip(each, rows, strict=True)]
        for each in (
            [one.x / law.over.per_unit for one in rows],
            [one.carrier for one in rows],
            [one.before for one in rows],
            [one.after for one in rows],
        )
    )
    angle, c = 2.0 * np.pi * np.concatenate(turns), np.concatenate(carrier)
    step = max(angle.size // SPECTRUM_ROWS, 1)
    span = max(float(np.ptp(one)) for one in turns)
    spacing = 0.25 / max(span, 1e-12)  # a line is four of them wide
    most = ORDERS / 2 * spacing
    orders = np.arange(order - min(order, most) + spacing, order + min(max(order, 1.0), most), spacing)
    orders = np.sort(np.append(orders, order))
    left = [np.concatenate(one) for one in (before, after)]
    left = [(one - c * float(c @ one) / float(c @ c)) * c for one in left]
    angle, left, weight = angle[::step], [one[::step] for one in left], float(np.sum(c[::step] ** 2))
    found = np.array([[abs(np.exp(-1j * n * angle) @ one) for one in left] for n in orders]) * 2.0 / weight
    return orders, found[:, 0], found[:, 1]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
