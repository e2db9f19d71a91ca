"""hil identify."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.runs import read_run
from hil.report.console import err, out, table


def identify(
    run: Annotated[Path, typer.Argument(help="Recording of the axis: .parquet, .arrows or .csv.", show_default=False)],
    target: Annotated[
        Path | None,
        typer.Option("--out", help="Bench file to write. Default: the name of the recording, in this folder."),
    ] = None,
) -> None:
    """Write a bench file of the axis from a recording alone: masses, friction, lead, gains, encoders, with errors."""
    from hil.bench.bench_file import load_bench
    from hil.commands.warm_up import compile_kernels
    from hil.drafting.bench_text import bench_text
    from hil.drafting.draft_bench import draft_bench
    from hil.errors import InputError
    from hil.files.output import write_text

    target = target or Path(f"{run.stem}.yaml")
    if target.exists():
        raise InputError(f"{target}: the file exists and is not overwritten; give another name with --out or remove it")
    if target.suffix not in (".yaml", ".yml"):
        raise InputError(f"{target}: given the ending {target.suffix!r}, allowed .yaml; correct --out")
    recording = read_run(run)
    compile_kernels()
    draft = draft_bench(recording)
    write_text(target, bench_text(draft))
    load_bench(target)
    values = [*draft.axis, *draft.control]
    rows = [
        (one.key, f"{one.value:.6g}" if isinstance(one.value, float) else str(one.value), one.error) for one in values
    ]
    rows += [] if draft.control else [("control", "unknown", draft.control_why)]
    table(("", "value", "unit, standard error"), rows)
    for note in draft.notes:
        out.print(f"  {note}", markup=False)
    for note in draft.unsure:
        err.print(f"Please check: {note}", markup=False)
    out.print(f"Bench: {target} ({draft.model})")
