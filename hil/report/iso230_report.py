"""Report of `hil iso230`: tables, pictures and numbers of ISO 230-2 and ISO 230-4."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hil.files.optional_library import missing_of
from hil.files.output import write_json
from hil.positioning.accuracy import FIGURES, PositioningAccuracy
from hil.positioning.accuracy_picture import deviations_over_position
from hil.positioning.circle import CircularAccuracy, title_of
from hil.positioning.circle_picture import draw_circle
from hil.quantities import digits, quantity, reading_unit
from hil.report.page import Page

SCHEMA_VERSION = 1
CIRCLE_HEADERS = ("", "ISO 230-4:2005", "")
_UNCERTAINTY = "The uncertainty of the measurement (ISO/TR 230-9) is neither taken off the figures nor added to them."


def accuracy_rows(results: Sequence[PositioningAccuracy]) -> list[list[str]]:
    """Rows of the table: symbol, meaning, and the value of each run."""
    return [
        [symbol, meaning, *(quantity(one.figures[name], one.unit) for one in results)]
        for name, (symbol, meaning) in FIGURES.items()
    ]


def accuracy_headers(results: Sequence[PositioningAccuracy]) -> list[str]:
    """Headers of that table."""
    return ["", "ISO 230-2:2014", *(one.name for one in results)]


def circle_rows(result: CircularAccuracy) -> list[list[str]]:
    """Rows of the table: symbol, meaning, value; then the quadrant spikes."""
    rows = [[*title_of(name), quantity(value, "m")] for name, value in result.figures.items()]
    for sense, path in result.paths.items():
        for at, spike in result.spikes_m[sense].items():
            rows.append(["", f"quadrant spike at {at}°, {path.name}", quantity(spike, "m")])
    return rows


def write_accuracy(results: Sequence[PositioningAccuracy], folder: Path) -> None:
    """Write iso230.json of one run or several, and with the libraries of the extra `report` the page and its PNG."""
    runs = [accuracy_json(one) for one in results]
    write_json(folder / "iso230.json", {"schema_version": SCHEMA_VERSION, "runs": runs})
    if not missing_of("report"):
        _accuracy_page(results, folder)


def write_circle(result: CircularAccuracy, folder: Path) -> None:
    """Write iso230.json of a circular test, and with the libraries of the extra `report` the page and its PNG."""
    numbers = {
        "schema_version": SCHEMA_VERSION,
        "x": result.x_name,
        "y": result.y_name,
        "radius_m": result.radius_m,
        "feed_m_s": result.feed_m_s,
        "figures": dict(result.figures),
        "spikes_m": {path.name: dict(result.spikes_m[sense]) for sense, path in result.paths.items()},
    }
    write_json(folder / "iso230.json", numbers)
    if not missing_of("report"):
        _circle_page(result, folder)


def _accuracy_page(results: Sequence[PositioningAccuracy], folder: Path) -> None:
    from hil.figures.drawing import save

    names = ", ".join(one.name for one in results)
    verdict = " ".join(f"{one.name}: {one.verdict}" if len(results) > 1 else one.verdict for one in results)
    page = Page(f"Positioning of {names}", "accuracy and repeatability by ISO 230-2:2014", verdict, True)
    page.table(accuracy_headers(results), accuracy_rows(results), left=(0, 1))
    page.picture(
        save(deviations_over_position(results), folder / "deviations.png"),
        "Mean deviation at each target, approached forward and backward, with its band of ± 2 s; dots: single cycles.",
    )
    notes = [f"{one.name}: {note}" for one in results for note in one.notes]
    if notes:
        page.items(notes)
    for one in results:
        page.heading(f"Targets of {one.name}")
        page.table(*_targets(one), left=())
    page.text(_UNCERTAINTY)
    page.write(folder / "iso230.html")


def _circle_page(result: CircularAccuracy, folder: Path) -> None:
    from hil.figures.drawing import save

    page = Page(
        f"Circle of {result.x_name} and {result.y_name}",
        f"circular test by ISO 230-4, radius {quantity(result.radius_m, 'm')}, feed {quantity(result.feed_m_s, 'm/s')}",
        result.verdict,
        True,
    )
    page.table(CIRCLE_HEADERS, circle_rows(result), left=(0, 1))
    page.picture(
        save(draw_circle(result), folder / "circle.png"),
        "Paths with their radial deviation enlarged; radial deviation over the angle, 0° at the positive end of "
        f"{result.x_name}. About the least-squares centre of each path.",
    )
    page.text(f"Quadrant spikes are no figure of the standard. {_UNCERTAINTY}")
    page.write(folder / "iso230.html")


def accuracy_json(one: PositioningAccuracy) -> dict[str, Any]:
    """Numbers of a run in SI units."""
    return {
        "name": one.name,
        "unit": one.unit,
        "figures": dict(one.figures),
        "target_m": one.target_m.tolist(),
        "forward_m": one.deviations.forward_m.tolist(),
        "backward_m": one.deviations.backward_m.tolist(),
        "notes": list(one.notes),
    }


def _targets(one: PositioningAccuracy) -> tuple[list[str], list[list[str]]]:
    """Headers and rows of the means, estimators, reversal and repeatability at each target."""
    length = reading_unit(one.unit, float(abs(one.target_m).max()))
    small = reading_unit(one.unit, float(abs(one.mean_m).max()))
    headers = [f"target [{length.unit}]", *(f"{what} [{small.unit}]" for what in ("x̄↑", "x̄↓", "s↑", "s↓", "B", "R"))]
    columns = (*one.mean_m, *one.estimator_m, one.reversal_at_m, one.repeatability_at_m)
    rows = [
        [digits(length.factor * place, 5), *(digits(small.factor * float(column[row]), 3) for column in columns)]
        for row, place in enumerate(one.target_m.tolist())
    ]
    return headers, rows
