"""Pictures of a trend: all quantities of an axis over months, and one small curve for a table."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from hil.figures.panels import GOOD
from hil.fleet.trend import DAY_S, AxisTrend, Course
from hil.quantities import reading_unit

if TYPE_CHECKING:
    from hil.figures.drawing import Drawing

_WIDTH, _HEIGHT, _POINTS = 150.0, 34.0, 60  # of a small curve [px], and dots in it
_SERVICE = GOOD
# quantities that share a panel: both directions
_TOGETHER = {"coulomb_back": "coulomb_forward", "viscous_back": "viscous_forward"}


def small_curve(course: Course) -> Markup:
    """A quantity over its recordings as SVG: dots, the stretches between changes as lines, services dotted."""
    day, values = course.day, course.values
    if day.size < 2:
        return Markup("")
    chosen = np.unique(np.linspace(0, day.size - 1, min(day.size, _POINTS)).astype(int))
    low, high = float(values.min()), float(values.max())
    if course.history:  # what scatters only is drawn as small as it is
        middle, least = 0.5 * (low + high), 4.0 * course.history.scatter
        low, high = min(low, middle - least), max(high, middle + least)
    span = max(high - low, 1e-300)

    def at(x: float, y: float) -> str:
        return f"{3 + (_WIDTH - 6) * (x - day[0]) / (day[-1] - day[0]):.1f},{3 + (_HEIGHT - 6) * (high - y) / span:.1f}"

    dots = "".join(f"M{at(day[one], values[one])}h0" for one in chosen)
    lines = ""
    if course.history is not None:
        for one in course.history.stretches:
            lines += f"M{at(day[one.first], one.begin)}L{at(day[one.last - 1], one.end)}"
    return Markup(
        f'<svg width="{_WIDTH:g}" height="{_HEIGHT:g}" role="img" fill="none">'
        f'<path d="{dots}" stroke="currentColor" stroke-opacity="0.45" stroke-width="3" stroke-linecap="round"/>'
        f'<path d="{lines}" stroke="var(--warning)" stroke-width="2"/></svg>'
    )


def all_courses(trend: AxisTrend) -> Drawing:
    """Draw every quantity that is told, those that need a look first, with changes, their intervals and services."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    from hil.figures.drawing import Drawing, style_axis

    panels = _panels(trend)
    rows = -(-len(panels) // 2)
    height = 0.5 + 1.75 * rows
    figure = Drawing(9.6, height)
    figure.set_layout_engine(None)  # to compute the margins takes as long as to draw
    figure.subplots_adjust(0.08, 0.35 / height, 0.985, 1.0 - 0.3 / height, wspace=0.22, hspace=0.32)
    axes = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for axis, courses in zip(axes.flat, panels, strict=False):
        largest = max(float(np.max(np.abs(one.values))) for one in courses)
        factor, unit = reading_unit(courses[0].quantity.unit_of(trend.linear), largest)
        for number, course in enumerate(courses):
            _draw(axis, course, factor, number)
        for service in trend.services:
            axis.axvline(_date(service.day), color=_SERVICE, linestyle=":", linewidth=1.2)
        label = courses[0].quantity.label
        title = label if len(courses) == 1 else label.replace(", forward", ": forward, back (pale)")
        style_axis(axis, f"[{unit or '1'}]")
        axis.set_title(title, loc="left", fontsize=9)
        axis.tick_params(labelsize=8)
    for axis in axes.flat[len(panels) :]:
        axis.axis("off")
    for axis in axes.flat[: len(panels)][-2:]:
        locator = AutoDateLocator(minticks=3, maxticks=7)  # type: ignore[no-untyped-call]
        axis.xaxis.set_major_locator(locator)
        axis.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
        axis.tick_params(labelbottom=True)
    return figure


def _panels(trend: AxisTrend) -> list[list[Course]]:
    told = {one.quantity.name: one for one in trend.courses if one.values.size > 1}
    groups = [
        [told[name], *(told[other] for other, first in _TOGETHER.items() if first == name and other in told)]
        for name in told
        if _TOGETHER.get(name) not in told
    ]
    return sorted(groups, key=lambda group: -max(one.need for one in group))


def _draw(axis: Any, course: Course, factor: float, number: int) -> None:
    from hil.figures.panels import MEASURED, SIMULATED

    pale = 0.4 if number else 1.0
    days = [_date(one) for one in course.day]
    axis.errorbar(
        days, factor * course.values, yerr=factor * course.errors,
        fmt=".", color=MEASURED, markersize=3.5, elinewidth=0.7, alpha=0.65 * pale,
    )  # fmt: skip
    if course.history is None:
        return
    for one in course.history.stretches:
        ends = [_date(course.day[one.first]), _date(course.day[one.last - 1])]
        axis.plot(ends, [factor * one.begin, factor * one.end], color=SIMULATED, linewidth=1.8, alpha=pale)
    for at, change in enumerate(course.history.changes):
        colour = _SERVICE if at in (course.explained or {}) else SIMULATED
        axis.axvspan(_date(change.earliest), _date(change.latest), color=colour, alpha=0.18 * pale, linewidth=0)


def _date(day: float) -> datetime:
    return datetime.fromtimestamp(day * DAY_S, UTC)


def legend() -> str:
    """What the picture shows."""
    return (
        "Blue: one recording each, with its standard error. Orange: stretches without a change. Bands: the 95 % "
        "interval of a change; green if something was serviced then, dotted line."
    )
