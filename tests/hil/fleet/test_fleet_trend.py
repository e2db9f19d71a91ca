"""Trends of axes and their pages: which axis first, why, what a service explains, and what cannot be told."""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from fleet_rows import BEGIN_DAY, rows_of, write_conditions
from typer.testing import CliRunner

from hil.cli import app
from hil.errors import InputError
from hil.fleet.engine import Engine
from hil.fleet.fleet import PAGE, Fleet
from hil.fleet.fleet_page import fleet_page
from hil.fleet.store import RESULTS, Row, Store
from hil.fleet.trend import AxisTrend, Service, read_services, trend
from hil.fleet.words import by_test, told_changes, why
from hil.workers.pool import Workers

SERVICED = Service(BEGIN_DAY + 7.0 * 30.0, "encoder exchanged")


def of(rows: list[Row], services: Sequence[Service] = ()) -> AxisTrend:
    return trend("axis", rows, services, linear=False)


def test_a_step_of_backlash_needs_a_look_and_says_when() -> None:
    found = of(rows_of("axis", 60, 1, {"reversal": (40, 1.6)}))
    assert found.leading is not None
    assert found.leading.quantity.name == "reversal"
    assert 1.1 < found.need < 1.5  # 12.8 µm of 10 µm
    told = why(found)
    assert told.startswith("reversal difference of the encoders: +12.")
    assert "stepped between 2025-10-01 and 2025-10-08" in told
    assert by_test(found)["backlash test"].startswith("20.8 µm (+12.")
    assert by_test(found)["stiffness test"] == "200 N/µm"


def test_less_friction_is_better_and_needs_nothing() -> None:
    found = of(rows_of("axis", 60, 2, {"coulomb_forward": (30, -0.4), "coulomb_back": (30, -0.4)}))
    assert found.need == 0.0
    assert why(found).startswith("changes for the better only: Coulomb friction")


def test_growing_friction_counts_as_it_will_be_in_thirty_days() -> None:
    found = of(rows_of("axis", 60, 3, slopes={"coulomb_forward": 0.006}))
    course = found.leading
    assert course is not None
    assert course.need == pytest.approx((0.006 * (59 + 30 / 7)) / 0.3, rel=0.1)
    assert "a month now" in told_changes(course, False)


def test_what_was_serviced_is_no_wear() -> None:
    rows = rows_of("axis", 60, 4, {"table_delay": (30, 6.0)})
    assert of(rows).need > 1.0
    found = of(rows, [SERVICED])
    assert found.need == 0.0
    assert not found.changed
    assert "steady since it was serviced: encoder exchanged" in why(found)


def test_what_is_not_told_says_why() -> None:
    few = of(rows_of("axis", 5, 5))
    assert why(few) == "too few recordings to tell changes: 5, allowed 12 or more"
    found = of(rows_of("axis", 40, 5, untold={"reversal": "no encoder at the table"}))
    course = next(one for one in found.courses if one.quantity.name == "reversal")
    assert (course.need, told_changes(course, False)) == (0.0, "no encoder at the table")
    assert "backlash test" not in by_test(found)


def test_a_date_that_is_none_is_told_with_its_line() -> None:
    assert read_services("date,what\n2025-07-30,oil, and belt\n", "x") == [Service(BEGIN_DAY + 210.0, "oil, and belt")]
    with pytest.raises(InputError, match=r"service\.csv:2: given 'May', allowed a date"):
        read_services("date,what\nMay,oil\n", "service.csv")


def test_pages_of_three_axes(tmp_path: Path) -> None:
    store = Store(str(tmp_path / "hall"))
    results = store.within(RESULTS)
    for name, steps in (("x", {}), ("y", {"reversal": (40, 1.6)}), ("z", {"lead_error": (20, 1.0)})):
        write_conditions(results, name, rows_of(name, 60, 7, steps))
    bad = {"id": "bad", "axis": "x", "file": "x/cut.parquet", "status": "bad", "reason": "it is cut", "moment": None}
    connect = lambda: Workers(ThreadPoolExecutor(1), lambda: 1)  # noqa: E731
    one = Fleet(store, Engine(results, connect, lambda *told: None))
    write_conditions(results, "x", [*rows_of("x", 60, 7), bad])
    rows = {row["axis"]: row for row in one.trend()}
    assert {axis: row["changed"] for axis, row in rows.items()} == {"x": False, "y": True, "z": True}
    assert one.pointed_at() == ["y/0059.parquet", "z/0059.parquet"]
    page = (tmp_path / "hall" / RESULTS / PAGE).read_text(encoding="utf-8")
    assert "1 of 3 axes need a look: y." in page
    assert page.index('href="axes/y.html"') < page.index('href="axes/z.html"') < page.index('href="axes/x.html"')
    assert "it is cut" in page
    axis = (tmp_path / "hall" / RESULTS / "axes" / "y.html").read_text(encoding="utf-8")
    assert "data:image/png" in axis
    assert "backlash test" in axis
    told = json.loads((tmp_path / "hall" / RESULTS / "axes" / "y.json").read_text(encoding="utf-8"))
    (change,) = next(one["changes"] for one in told["quantities"] if one["quantity"] == "reversal")
    assert (change["earliest"], change["latest"]) == ("2025-10-01", "2025-10-08")
    one.trend()  # nothing is new: pages are kept
    assert rows == {row["axis"]: row for row in one.results.rows("trends")}


def test_the_page_of_300_axes_stays_small() -> None:
    from hil.fleet.curves import small_curve

    found = of(rows_of("axis", 200, 8, {"reversal": (40, 1.6)}))
    assert found.leading is not None
    row: Row = {
        "need": found.need, "why": why(found), "curve": str(small_curve(found.leading)), "good": 200, "bad": 3,
        "tests": json.dumps(by_test(found)), "service": "2025-07-01 lubricated", "changed": True,
    }  # fmt: skip
    page = fleet_page("hall", [row | {"axis": f"axis-{at:03d}"} for at in range(300)], [])
    assert len(page) < 3_000_000
    assert page.count(b'href="axes/axis-') == 600


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["trend", "FOLDER", "--all"], "--all: given with trend, allowed with diagnose"),
        (["trend", "FOLDER"], "nothing is compared yet; call first: hil fleet compare"),
        (["index", "nowhere://x"], "nowhere://x: cannot be opened"),
        (["compare", "FOLDER", "--tls", "FOLDER"], "--tls: given without --scheduler"),
    ],
)
def test_wrong_arguments_are_told(arguments: list[str], told: str, tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["fleet", *(str(tmp_path) if one == "FOLDER" else one for one in arguments)])
    assert isinstance(ran.exception, InputError)
    assert told in str(ran.exception)
