"""hil frf."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.options import Out, RecordedBench
from hil.commands.runs import read_run
from hil.report.console import err, out, progress, table


def frf(
    run: Annotated[
        Path,
        typer.Argument(
            help="Recording of a multisine or a chirp, such as one of profiles/frequency_response.yaml.",
            show_default=False,
        ),
    ],
    bench: RecordedBench = None,
    folder: Out = None,
    show: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
) -> None:
    """Measure frequency responses and stability margins of an axis, beside those of its twin."""
    from hil.bench.bench_file import load_bench
    from hil.files.output import default_folder, new_folder
    from hil.frequency.measure import frf as measure
    from hil.frequency.table import HEADERS, range_text, rows_of, verdict
    from hil.identification.measured import bench_of
    from hil.report.frf_report import FurtherPicture, write_frf
    from hil.validation.paper.measured import over_the_paper

    recording = read_run(run)
    believed = load_bench(bench) if bench else bench_of(recording)
    folder = folder or default_folder(f"frf-{recording.name}")
    with new_folder(folder) as part, progress() as tell:
        tell("estimating")
        result = measure(recording, believed)
        tell("writing the report")
        pictures = [FurtherPicture(part / one.file, one.caption) for one in over_the_paper(result, believed, part)]
        write_frf(result, part, "Over the figures of the source paper", pictures)
    table(HEADERS, rows_of(result))
    coherence = result.coherence[result.measured["plant_motor"].trusted]
    out.print(f"\ntrustworthy from {range_text(*result.trusted_hz)}: coherence {coherence.min():.2f} or more")
    for note in result.notes:
        err.print(f"note: {note}", markup=False)
    out.print(f"\n{verdict(result)}\n\nReport: {folder / 'frf.html'}")
    if show:
        typer.launch(str(folder / "frf.html"))
