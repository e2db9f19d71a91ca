"""The page of a fleet: which axis needs a look first, and all axes under the names of the vendors' tests."""

import json
from collections.abc import Sequence

from markupsafe import Markup, escape

from hil.fleet.axis_page import page_content
from hil.fleet.quantities import BACKLASH, EQUABILITY, FREQUENCY, FRICTION, NO_RESPONSE, QUADRANT, STIFFNESS
from hil.fleet.store import Row
from hil.fleet.trend import AHEAD_DAYS
from hil.fleet.words import NEED, need_told
from hil.report.page import Page

TESTS = (EQUABILITY, FRICTION, BACKLASH, QUADRANT, STIFFNESS)


def fleet_page(name: str, rows: Sequence[Row], bad: Sequence[Row]) -> bytes:
    """The page of all axes; `rows` are those of their trends, `bad` those of recordings that cannot be used."""
    ordered = sorted(rows, key=lambda row: (-row["need"], row["axis"]))
    need = [row["axis"] for row in ordered if row["need"] >= 1.0]
    changed = sum(row["changed"] and row["need"] < 1.0 for row in rows)
    few = ", ".join(need[:5]) + (f" and {len(need) - 5} more" if len(need) > 5 else "")
    verdict = f"{len(need)} of {len(rows)} axes need a look" + (f": {few}." if need else ".")
    recordings = sum(row["good"] for row in rows)
    page = Page(
        name,
        f"{len(rows)} axes, {recordings} good recordings, {len(bad)} bad · axes that change, but less than calls "
        f"for a look: {changed}",
        verdict,
        not need,
        f"{NEED} From 1 on the axis needs a look within {AHEAD_DAYS:g} days.",
    )
    page.heading("Which axis first")
    page.table(
        ("axis", "need", "why", "curve of that quantity", "recordings", "bad", "last service"),
        [
            (_link(row["axis"]), need_told(row["need"]), row["why"], Markup(row["curve"]), str(row["good"]),
             str(row["bad"] or "–"), row["service"] or "–")
            for row in ordered
        ],
        left=(0, 2, 3, 6),
    )  # fmt: skip
    page.heading("Under the names of the vendors' tests")
    page.text(
        "Level now and, if it changed, how much against the first level or that after the last service. Friction: "
        "Coulomb friction forward. Backlash: reversal difference of the encoders. A dash: the recordings do not tell "
        f"it; the page of the axis says why. {FREQUENCY.capitalize()}: {NO_RESPONSE}."
    )
    page.table(
        ("axis", *TESTS, FREQUENCY),
        [
            (_link(row["axis"]), *(json.loads(row["tests"]).get(test, "–") for test in TESTS), "–")
            for row in sorted(rows, key=lambda row: str(row["axis"]))
        ],
    )
    if bad:
        page.heading("Bad recordings")
        shown = sorted(bad, key=lambda row: str(row["file"]))[:200]
        page.table(("file", "reason"), [(row["file"], row["reason"]) for row in shown], left=(0, 1))
        if len(bad) > len(shown):
            page.text(f"And {len(bad) - len(shown)} more: the pages of the axes have them.")
    return page_content(page)


def _link(axis: str) -> Markup:
    return Markup(f'<a style="white-space: nowrap" href="axes/{escape(axis)}.html">{escape(axis)}</a>')
