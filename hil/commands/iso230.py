"""hil iso230."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.options import Out
from hil.commands.runs import read_run
from hil.report.console import err, out, progress, table


def iso230(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Recordings with standstill at targets, such as of profiles/positioning_iso_230_2.yaml, or CSV files "
            "of laser readings (target_mm, reading_mm); several stand side by side.",
            show_default=False,
        ),
    ] = None,
    circle: Annotated[
        tuple[Path, Path] | None,
        typer.Option(
            help="Recordings of the two axes of a circle, such as of profiles/circle_x.yaml and circle_y.yaml: "
            "ISO 230-4 instead.",
            show_default=False,
        ),
    ] = None,
    folder: Out = None,
    show: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
) -> None:
    """Judge positions by ISO 230-2 (accuracy, repeatability, reversal) or a circle of two axes by ISO 230-4."""
    from hil.errors import InputError
    from hil.files.optional_library import page_line
    from hil.files.output import default_folder, new_folder
    from hil.positioning.accuracy import positioning_accuracy
    from hil.positioning.circle import circular_accuracy
    from hil.report.iso230_report import (
        CIRCLE_HEADERS,
        accuracy_headers,
        accuracy_rows,
        circle_rows,
        write_accuracy,
        write_circle,
    )

    if bool(runs) == bool(circle):
        raise InputError(
            "iso230: given neither or both of recordings and --circle, allowed one; give recordings with standstill at "
            "targets, or --circle X Y"
        )
    if circle:
        result = circular_accuracy(*(read_run(path) for path in circle))
        folder = folder or default_folder(f"iso230-{result.x_name}-{result.y_name}")
        with new_folder(folder) as part, progress() as tell:
            tell("writing the report")
            write_circle(result, part)
        table(CIRCLE_HEADERS, circle_rows(result), right=False)
        verdict = result.verdict
    else:
        results = [positioning_accuracy(path if _readings(path) else read_run(path)) for path in runs or ()]
        folder = folder or default_folder(f"iso230-{results[0].name}")
        with new_folder(folder) as part, progress() as tell:
            tell("writing the report")
            write_accuracy(results, part)
        table(accuracy_headers(results), accuracy_rows(results), right=False)
        for one in results:
            for note in one.notes:
                err.print(f"note: {one.name}: {note}", markup=False)
        verdict = "\n".join(f"{one.name}: {one.verdict}" for one in results)
    out.print(f"\n{verdict}\n\n{page_line(folder / 'iso230.html')}")
    if show:
        typer.launch(str(folder / "iso230.html"))


def _readings(path: Path) -> bool:
    """True for a CSV of readings; a recording as CSV has other columns."""
    from hil.files.csv_columns import read_header

    return path.suffix.lower() == ".csv" and any(name.strip().startswith("target_") for name in read_header(path))
