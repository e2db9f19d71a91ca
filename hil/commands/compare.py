"""hil compare."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.options import Out, RecordedBench
from hil.report.console import out, progress, table


def compare(
    run: Annotated[Path, typer.Argument(help="Recording: .parquet, .arrows or .csv.", show_default=False)],
    bench: RecordedBench = None,
    fit: Annotated[bool, typer.Option("--fit", help="First fit the parameters of the axis to the recording.")] = False,
    folder: Out = None,
) -> None:
    """Compare a recording with its twin: in closed loop from the same set-points, and block by block."""
    from hil.bench.bench_file import load_bench
    from hil.commands.warm_up import compile_kernels
    from hil.files.output import default_folder, new_folder
    from hil.identification.compare import compare as compare_recording
    from hil.identification.measured import bench_of
    from hil.recording.recording import read_recording
    from hil.report.compare_report import PARAMETER_HEADERS, parameter_rows, rows_of, verdict, write_comparison

    recording = read_recording(run)
    believed = load_bench(bench) if bench else bench_of(recording)
    folder = folder or default_folder(f"compare-{recording.name}")
    compile_kernels()
    with new_folder(folder) as part, progress() as tell:
        result = compare_recording(recording, believed, fit=fit, progress=tell)
        tell("writing the report")
        write_comparison(result, part)
    table(("measured - simulated", "rms", "largest", "relative"), rows_of(result))
    if result.fit is not None:
        out.print()
        table(PARAMETER_HEADERS, parameter_rows(result.fit))
    out.print(f"\n{verdict(result)}\n\nReport: {folder / 'compare.html'}")
