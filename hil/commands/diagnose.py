"""hil diagnose."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.options import Out, RecordedBench
from hil.commands.runs import read_run
from hil.report.console import out, print_look, progress


def diagnose(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN...", show_default=False, help="Training recordings: .parquet, .arrows or .csv."),
    ],
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            help="Held-out recording of another motion, on which the result is validated; may be given several times. "
            "Default: a third of each recording.",
        ),
    ] = None,
    bench: RecordedBench = None,
    folder: Out = None,
    budget_s: Annotated[
        float | None,
        typer.Option(
            "--budget",
            metavar="SECONDS",
            help="Processor time after which the search ends with the best answer so far; it says what was not tried. "
            "Default: 110 s, up to four times as much for more than 40 000 rows.",
        ),
    ] = None,
) -> None:
    """Find physics that the twin lacks: where it acts, which mechanism it is, and whether modelling it helps."""
    from hil.drafting.first_look import first_look

    train = [read_run(path) for path in runs]
    held_out = [read_run(path) for path in validate or []]
    print_look(first_look(train))

    # what follows loads compiled kernels and more, for which the first look does not wait
    from hil.bench.bench_file import load_bench
    from hil.commands.warm_up import compile_kernels
    from hil.compensating.old_tables import old_tables, reach_of_recording
    from hil.diagnosis.diagnose import diagnose as diagnose_recordings
    from hil.files.optional_library import page_line
    from hil.files.output import default_folder, new_folder
    from hil.files.shipped import given_or_shipped
    from hil.identification.measured import bench_of
    from hil.report.diagnosis_report import write_diagnosis
    from hil.report.summary import print_diagnosis

    believed = load_bench(bench) if bench else bench_of(train[0])
    folder = folder or default_folder(f"diagnose-{train[0].name}")
    compile_kernels(of_loop=False)
    with new_folder(folder) as part:
        with progress() as tell:
            diagnosis = diagnose_recordings(train, held_out, believed, tell, budget_s)
        print_diagnosis(diagnosis.result)
        has_setpoints = {"position_command_m", "velocity_command_m_s"} <= set(train[0].columns)
        if believed.tables().tables and believed.law_known and has_setpoints:
            for line in old_tables(diagnosis.bench, reach_of_recording(train[0], believed)):
                out.print(line)
        with progress() as tell:
            tell("writing the report")
            write_diagnosis(diagnosis, part, bench_file=given_or_shipped(bench, "bench") if bench else None)
    out.print(page_line(folder / "report.html"))
