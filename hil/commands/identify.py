"""hil identify."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.runs import read_run
from hil.report.console import err, out, table


def identify(
    runs: Annotated[
        list[Path], typer.Argument(help="Recordings of one axis: .parquet, .arrows or .csv.", show_default=False)
    ],
    target: Annotated[
        Path | None,
        typer.Option("--out", help="Bench file to write. Default: the name of the first recording, in this folder."),
    ] = None,
) -> None:
    """Write a bench file of an axis from its recordings alone: masses, friction, lead, gains, encoders, with errors."""
    from hil.commands.warm_up import compile_kernels
    from hil.drafting.drafted_bench import drafted
    from hil.errors import InputError
    from hil.files.input_file import is_file
    from hil.files.output import write_text

    target = target or Path(f"{runs[0].stem}.yaml")
    if is_file(target):
        raise InputError(f"{target}: the file exists and is not overwritten; give another name with --out or remove it")
    if target.suffix not in (".yaml", ".yml"):
        raise InputError(f"{target}: given the ending {target.suffix!r}, allowed .yaml; correct --out")
    recordings = [read_run(run) for run in runs]
    compile_kernels(of_loop=False)
    found = drafted(recordings)
    draft = found.draft
    write_text(target, found.text)
    rows = [(one.key, one.shown, one.error) for one in found.values]
    rows += [] if draft.control else [("control", "unknown", draft.control_why)]
    table(("", "value", "unit, standard error"), rows)
    for note in draft.notes:
        out.print(f"  {note}", markup=False)
    for note in draft.unsure:
        err.print(f"Please check: {note}", markup=False)
    out.print(f"Bench: {target} ({draft.axis.model})")
