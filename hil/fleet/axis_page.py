"""The page of one axis: its quantities over months, changes, services, bad recordings."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from markupsafe import Markup, escape

from hil.fleet.curves import all_courses, legend
from hil.fleet.quantities import FREQUENCY, NO_RESPONSE
from hil.fleet.store import Row
from hil.fleet.trend import AxisTrend, date_of
from hil.fleet.words import NEED, limit_of, need_told, told_changes, value_of, why
from hil.report.page import Page

HEADERS = ("quantity", "vendors' test", "now", "calls for a look", "need", "changes")


def axis_page(trend: AxisTrend, diagnoses: Sequence[Row]) -> bytes:
    """The page of an axis; `diagnoses` are rows of full diagnoses of its recordings."""
    course = next((one for one in trend.courses if one.day.size), None)
    period = f"{date_of(course.day[0])} to {date_of(course.day[-1])}" if course else "none is good"
    told = f"Needs a look: {why(trend)}." if trend.need >= 1.0 else f"{why(trend)[:1].upper()}{why(trend)[1:]}."
    page = Page(
        trend.axis,
        f"{trend.good} good recordings, {period}; {len(trend.bad)} bad · need {need_told(trend.need)}",
        told,
        trend.need < 1.0,
        NEED,
    )
    page.heading("Over months")
    if any(one.values.size > 1 for one in trend.courses):
        with TemporaryDirectory() as folder:
            path = Path(folder, "trend.png")
            all_courses(trend).savefig(path, dpi=100)
            page.picture(path, legend())
    page.heading("Quantities")
    rows = [
        (
            one.quantity.label,
            one.quantity.test or "–",
            value_of(one, trend.linear),
            limit_of(one.quantity, trend.linear),
            need_told(one.need),
            told_changes(one, trend.linear),
        )
        for one in sorted(trend.courses, key=lambda one: -one.need)
    ]
    page.table(HEADERS, [*rows, ("–", FREQUENCY, "–", "–", "–", NO_RESPONSE)], left=(0, 1, 5))
    if trend.services:
        page.heading("Serviced")
        page.table(("date", "what"), [(date_of(one.day), one.what) for one in trend.services], left=(0, 1))
    if diagnoses:
        page.heading("Diagnoses")
        links = [
            (Markup(f'<a href="../{escape(row["page"])}">{escape(row["file"])}</a>'), row["verdict"], row["statement"])
            for row in diagnoses
            if row["status"] == "good"
        ]
        page.table(("recording", "verdict", "statement"), links, left=(0, 1, 2))
    if trend.bad:
        page.heading("Bad recordings")
        page.table(("file", "reason"), [(row["file"], row["reason"]) for row in trend.bad], left=(0, 1))
    page.heading("How it was computed")
    page.items(
        [
            "The inertia of the axis is fitted once over its first recordings and held; friction, lost motion, lead "
            "error, stiffness and delays are linear regressions over each recording, with standard errors of a "
            "jackknife over blocks of rows.",
            "Changes are found by optimal partitioning into levels and lines, with a likelihood that decides between "
            "changes and correlated noise. A recording far from all that are next to it counts for no change; four at "
            "another level do. The threshold is such that at one recording and one look a day at most one false change "
            "a year is expected of white noise in all quantities of an axis together, two if it is correlated by 0.8.",
            "Assumed is noise whose correlation from one recording to the next is 0.8 at most: a slower wander, as of "
            "the season, counts as change. Until some 40 recordings a step below three times the scatter in their "
            "middle may be taken for such noise.",
            "The reversal difference holds play and the windup by friction at the table; the stiffness rests on the "
            "mass at the table as the bench file has it: its changes are measured, its level is as right as that mass.",
        ]
    )
    return page_content(page)


def page_content(page: Page) -> bytes:
    """The HTML of a page."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "page.html")
        page.write(path)
        return path.read_bytes()
