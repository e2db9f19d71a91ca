"""hil prove."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from hil.report.console import out, progress, table


class PlantChoice(StrEnum):
    """Plants of a proof."""

    SIMULATED = "simulated"
    MUJOCO = "mujoco"


def prove(
    more: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[FILE]...", show_default=False, help="Further recordings after --recording"),
    ] = None,
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            "--recording",
            help="Conceal effects in real recordings instead, .parquet, .arrows or .csv; may be repeated",
        ),
    ] = None,
    bench: Annotated[
        Path | None,
        typer.Option(
            "--bench", help="Bench file of the axis of all recordings; default: drafted from the other half of each"
        ),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for cases, answers and scores; continues an interrupted proof"),
    ] = None,
    cases: Annotated[int | None, typer.Option("--cases", help="Number of cases; default: 40")] = None,
    full: Annotated[bool, typer.Option("--full", help="The whole proof, 1340 cases: takes many hours")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draw")] = 1,
    plant: Annotated[
        PlantChoice,
        typer.Option("--plant", help="Our simulation, or MuJoCo, which must be installed (make peers)"),
    ] = PlantChoice.SIMULATED,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="A tier to draw from, as single or pair; may be repeated; default: all"),
    ] = None,
    hours: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="No diagnosis begins after this time; the first cases with an answer are scored, and the same "
            "command continues; default: no limit",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", "--jobs", min=1, help="Processes, each with its share of the cores; default: cores"),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            help="Diagnose on a dask.distributed cluster, as tcp://10.0.0.1:8786; needs the extra cluster of "
            "hil-servo; whoever reaches the scheduler executes code as its user: use it in a network that you trust",
        ),
    ] = None,
    show: Annotated[
        str | None, typer.Option("--show", help="Print the published tables of a run, as 20261206, and exit")
    ] = None,
) -> None:
    """Conceal effects in simulated axes, or in real recordings, seal the truth, diagnose blind, unseal and score."""
    import os
    import signal
    from math import inf

    from hil.commands.warm_up import compile_kernels
    from hil.errors import InputError
    from hil.validation.proof.draw.plan import PLANTS, plan
    from hil.validation.proof.run import prove as run
    from hil.validation.proof.run import score_others
    from hil.validation.proof.score.page import write_proof
    from hil.validation.proof.score.tables import HEADERS, goal_row, published

    if show is not None:
        out.print(published(show))
        return
    if folder is None:
        raise InputError("--out: not given, allowed a folder for cases, answers and scores; or --show NAME")
    jobs, limit = workers or len(os.sched_getaffinity(0)), inf if hours is None else hours
    if recording or more:
        if not recording or full or only or plant is not PlantChoice.SIMULATED:
            raise InputError(
                "--recording: given with --full, --only or --plant, or files without it; allowed --recording FILE FILE "
                "with --bench, --cases and --seed"
            )
        _on_recordings(
            [*recording, *(more or [])], bench, folder, 40 if cases is None else cases, seed, jobs, limit, scheduler
        )
        return
    if full and cases is not None:
        raise InputError(f"--full: given with --cases {cases}, allowed one of them")
    whole = sum(share for tier, share in PLANTS[plant].items() if not only or tier in only)
    count = whole if full else 40 if cases is None else cases
    planned = plan(count, seed, plant, only or ())
    tiers = [tier for tier in PLANTS[plant] if tier in (only or ())]
    compile_kernels()
    # ended by a service or kill: like ctrl-C, with all processes that were started
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with progress() as tell:
            scores = run(folder, planned, seed, jobs, out.print, tell, plant, tiers, limit, scheduler)
            tell("writing the report", None)
            write_proof(scores, score_others(folder, scores), folder)
    finally:
        signal.signal(signal.SIGTERM, before)
    table(HEADERS, [goal_row(goal) for goal in scores.goals])
    out.print(f"\nReport: {folder / 'report.html'}")


def _on_recordings(
    paths: list[Path],
    bench: Path | None,
    folder: Path,
    cases: int,
    seed: int,
    jobs: int,
    hours: float,
    scheduler: str | None,
) -> None:
    """Run the proof on real recordings."""
    import signal

    from hil.bench.bench_file import load_bench
    from hil.commands.runs import read_run
    from hil.commands.warm_up import compile_kernels
    from hil.validation.proof.run_real import prove_recordings
    from hil.validation.proof.score.real_page import write_real_proof
    from hil.validation.proof.score.tables import HEADERS, goal_row

    recordings = [read_run(path) for path in paths]
    believed = load_bench(bench) if bench is not None else None
    compile_kernels()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with progress() as tell:
            scores = prove_recordings(
                folder, recordings, believed, cases, seed, jobs, out.print, tell, hours, scheduler
            )
            tell("writing the report", None)
            write_real_proof(scores, folder)
    finally:
        signal.signal(signal.SIGTERM, before)
    table(HEADERS, [goal_row(goal) for goal in scores.goals])
    out.print(f"\nReport: {folder / 'report.html'}")
