"""hil friction."""

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.options import Out
from hil.commands.runs import read_run
from hil.report.console import out, progress, table


def friction(
    run: Annotated[
        Path | None,
        typer.Argument(help="Recording of a feed sweep. Without it, --profile is run on --bench.", show_default=False),
    ] = None,
    bench: Annotated[str | None, typer.Option(help="Bench file or name of a shipped bench.")] = None,
    profile: Annotated[
        Path | None, typer.Option(help="Feed sweep to run, or name of a shipped profile: friction_sweep.")
    ] = None,
    virtual: Annotated[
        bool, typer.Option("--virtual", help="Simulated bench: run --profile as fast as possible.")
    ] = False,
    folder: Out = None,
) -> None:
    """Identify Coulomb and viscous friction from constant feeds in both directions."""
    from hil.bench.bench_file import load_bench
    from hil.commands.warm_up import compile_kernels
    from hil.errors import InputError
    from hil.files.optional_library import page_line
    from hil.files.output import default_folder, new_folder
    from hil.identification.friction import identify_friction
    from hil.identification.measured import bench_of
    from hil.loop.simulated_bench import load_simulated
    from hil.report.friction_report import rows_of, verdict, write_friction

    if (run is None) == (profile is None):
        raise InputError(
            "friction: given neither or both of a recording and --profile, allowed one; "
            "give a recording, or --profile with --bench to run it"
        )
    if bench is None and run is None:
        raise InputError("friction: --bench is missing; give the bench that --profile runs on")
    believed = None
    if bench is not None:
        believed = load_bench(bench) if profile is None else load_simulated(bench)
    folder = folder or default_folder(f"friction-{(run or Path(str(bench))).stem}")
    if run is None:
        compile_kernels()
    with new_folder(folder) as part, progress() as tell:
        if bench is not None and profile is not None:
            tell("running the feed sweep")
            run = _run(bench, profile, part, virtual)
        assert run is not None
        recording = read_run(run)
        if believed is None and "bench" in recording.metadata:
            believed = bench_of(recording)
        tell("identifying")
        result = identify_friction(recording)
        write_friction(result, recording.name, believed, part)
    table(("", "value", "standard error", "bench file"), rows_of(result, believed))
    out.print(f"\n{verdict(result, believed)}\n\n{page_line(folder / 'friction.html')}")


def _run(bench: str, profile: Path, folder: Path, virtual: bool) -> Path:
    from hil.commands.run import named
    from hil.errors import HilError
    from hil.loop.run import run_profile
    from hil.loop.simulated_bench import load_simulated
    from hil.motion.profile import load_profile

    with named(bench, profile):
        ran = run_profile(load_simulated(bench), load_profile(profile), folder, "run", virtual=virtual)
    if not ran.complete or ran.recording is None:
        raise HilError(f"the feed sweep was not completed: {ran.outcome.ending}: {ran.outcome.reason}")
    return ran.recording
