"""hil paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.report.console import out, progress


def paper(
    folder: Annotated[
        Path | None, typer.Option("--out", help="New folder for the report; left out: runs/paper-TIME")
    ] = None,
) -> None:
    """Reproduce the source paper: what it prints, what comes out, why they differ, and its figures."""
    from hil.files.output import default_folder, new_folder
    from hil.paper import run_paper
    from hil.report.paper_report import verdict, write_paper

    folder = folder or default_folder("paper")
    with new_folder(folder) as part, progress() as tell:
        tell("computing the paper", None)
        result = run_paper(part)
        write_paper(result, part)
    out.print(f"{verdict(result)}\n\nReport: {folder / 'paper.html'}")
