"""hil compare."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.options import Out, RecordedBench
from hil.commands.runs import read_run
from hil.report.console import err, out, progress, table


def compare(
    run: Annotated[Path, typer.Argument(help="Recording: .parquet, .arrows or .csv.", show_default=False)],
    bench: RecordedBench = None,
    fit: Annotated[bool, typer.Option("--fit", help="First fit the parameters of the axis to the recording.")] = False,
    folder: Out = None,
) -> None:
    """Compare a recording with its twin: in closed loop from the same set-points, and block by block."""
    from hil.bench.bench_file import load_bench
    from hil.commands.warm_up import compile_kernels
    from hil.errors import InputError
    from hil.files.optional_library import page_line
    from hil.files.output import default_folder, new_folder
    from hil.identification.compare import Comparison
    from hil.identification.compare import compare as compare_recording
    from hil.identification.measured import bench_of
    from hil.report.compare_report import PARAMETER_HEADERS, parameter_rows, rows_of, write_comparison

    recording = read_run(run)
    believed = load_bench(bench) if bench else bench_of(recording)
    folder = folder or default_folder(f"compare-{recording.name}")
    compile_kernels(of_loop=False)
    parts, left_out = recording.parts(), list[str]()
    done = list[tuple[Comparison, Path]]()
    with new_folder(folder) as target, progress() as tell:
        for number, part in enumerate(parts, 1):
            try:
                result = compare_recording(part, believed, fit=fit, progress=tell)
            except InputError as error:
                if len(parts) == 1 or (not done and number == len(parts)):
                    raise
                left_out.append(str(error).splitlines()[0])
                continue
            tell("writing the report", None)
            place = Path() if len(parts) == 1 else Path(f"part-{number}")
            (target / place).mkdir(exist_ok=True)
            write_comparison(result, target / place)
            done.append((result, folder / place / "compare.html"))
    for reason in left_out:
        err.print(f"Left out: {reason}", markup=False)
    for result, page in done:
        if len(parts) > 1:
            out.print(f"\n{result.recording.name}, from {result.recording.start_s:.4g} s", markup=False)
        table(("measured - simulated", "rms", "largest", "relative"), rows_of(result))
        if result.fit is not None:
            out.print()
            table(PARAMETER_HEADERS, parameter_rows(result.fit))
        out.print(f"\n{result.statement}\n\n{page_line(page)}")
