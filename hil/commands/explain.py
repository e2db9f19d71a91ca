"""hil explain."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.commands.options import AxisInNames, Rate, Readme
from hil.report.console import err, out, print_look, progress, table

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis
    from hil.explanation import Basis


def explain(
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATA...", show_default=False, help="Recordings of one axis: any file that hil import reads."
        ),
    ],
    folder: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Folder for maps, bench and report; maps and bench that are there are used. "
            "Default: explained-NAME, of the first file, in this folder.",
        ),
    ] = None,
    rate_hz: Rate = None,
    axis: AxisInNames = None,
    readme: Readme = None,
    show: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
    budget_s: Annotated[
        float | None,
        typer.Option(
            "--budget",
            metavar="SECONDS",
            help="Processor time of the search; then the best answer so far. Default: 110 s, up to four times as much "
            "for more than 40 000 rows.",
        ),
    ] = None,
) -> None:
    """Explain recordings in one step: read them, draft the bench, find the physics that its twin lacks, write a page.

    Correct what was assumed in the map or the bench of the folder, and call it again.
    """
    from hil.commands.warm_up import compile_kernels
    from hil.explanation import OUTDATED
    from hil.explanation import explain as explain_files
    from hil.files.optional_library import page_line

    with progress() as tell:

        def look(lines: list[str]) -> None:
            print_look(lines)
            compile_kernels(tell, of_loop=False)

        def answer(diagnosis: "Diagnosis") -> None:
            from hil.report.summary import print_diagnosis

            print_diagnosis(diagnosis.result)

        found = explain_files(
            data,
            folder,
            rate_hz=rate_hz,
            axis=axis,
            readme=readme,
            progress=tell,
            look=look,
            first=_first_answer,
            answer=answer,
            budget_s=budget_s,
        )
    for warning in (one for one in found.assumed if OUTDATED in one):
        out.print(f"{warning}.\n")
    for line in _unsized(found.basis):
        out.print(f"{line}\n")
    out.print(page_line(found.report))
    if show and found.report.exists():
        import webbrowser

        webbrowser.open(found.report.resolve().as_uri())


def _first_answer(basis: "Basis") -> None:
    """Print what is known before the search."""
    if basis.draft is not None:
        table(
            ("", "value", "unit, standard error"),
            [(one.key, one.shown, one.error) for one in basis.draft.values],
        )
        for note in basis.draft.notes:
            out.print(f"  {note}")
    err.print("Assumed:")
    for note in basis.assumed:
        err.print(f"  - {note}")
    for line in _unsized(basis):  # before the minutes of a search
        err.print(line)


def _unsized(basis: "Basis") -> list[str]:
    return [
        f"Nothing tells the size of {', '.join(channels)}: values are multiples of the true ones, and a named "
        f"effect can be wrong. Write the size into {path} and run the command again."
        for path, channels in basis.unsized.items()
    ]
