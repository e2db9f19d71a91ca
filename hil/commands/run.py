"""hil run."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.commands.options import Force, Out, ResetFault, RunBench, Seed, Virtual
from hil.report.console import err, out

if TYPE_CHECKING:
    from hil.loop.run import RunResult


def run(
    profile: Annotated[
        Path, typer.Argument(help="Profile file, or name of a shipped profile: reference, jog, ...", show_default=False)
    ],
    bench: RunBench = "reference",
    virtual: Virtual = False,
    force: Force = False,
    reset_fault: ResetFault = False,
    seed: Seed = None,
    with_scope: Annotated[
        bool, typer.Option("--scope", help="Show the run in a browser; the scope ends when no page is open any more.")
    ] = False,
    folder: Out = None,
    bus_log: Annotated[
        Path | None,
        typer.Option(
            help="Log the bus from another process: .blf, .asc or .log (candump). hil import reads it.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Run a profile on a bench and record it. ctrl-C: controlled stop; again: stop by the drive's ramp.

    Exit code 3: the drive did not confirm that its power stage is off; switch it off at the mains.
    """
    from hil.commands.beside import scope_beside, status_line
    from hil.commands.warm_up import compile_kernels
    from hil.errors import HilError, InputError
    from hil.files.output import default_folder
    from hil.loop.bus_log import log_bus
    from hil.loop.run import run_profile
    from hil.loop.simulated_bench import load_simulated
    from hil.loop.supervision import Ending
    from hil.motion.profile import load_profile

    if with_scope and virtual:
        raise InputError("given --scope with --virtual, allowed with --wall: look at the recording with hil scope FILE")
    folder = folder or default_folder(profile.stem)
    loaded = load_simulated(bench)
    with named(bench, profile):
        wanted = load_profile(profile)
        compile_kernels()
        with log_bus(loaded, bus_log) if bus_log else nullcontext():
            if with_scope:
                scope_beside()
            with status_line(folder if err.is_terminal and not virtual else None):
                result = run_profile(
                    loaded, wanted, folder, profile.stem,
                    virtual=virtual, force=force, reset_fault=reset_fault, seed=seed,
                    planned=lambda trajectory: err.print(
                        f"{profile.stem} on {loaded.name}: {trajectory.duration_s:.1f} s of motion ..."))  # fmt: skip
            say(result, virtual)  # also where the log fails
    if bus_log:
        out.print(f"Log of the bus: {bus_log}")
    if result.outcome.ending is Ending.INTERRUPTED:
        raise typer.Exit(130)
    if not result.complete:
        raise HilError(f"stopped: {result.outcome.ending}: {result.outcome.reason}")


@contextmanager
def named(bench: str, profile: Path) -> Iterator[None]:
    """Name file and line in an error at a field of the bench or the profile."""
    from hil.errors import FieldError
    from hil.files.shipped import given_or_shipped
    from hil.files.yaml_model import located
    from hil.motion.profile import Profile

    try:
        yield
    except FieldError as error:
        of_profile = error.field[0] in Profile.model_fields
        path = given_or_shipped(profile, "profile") if of_profile else given_or_shipped(bench, "bench")
        raise located(path, error) from None


def say(result: RunResult, virtual: bool) -> None:
    """Print notes, lateness and file of a run."""
    for note in (*result.notes, *result.doubts):
        err.print(f"note: {note}")
    if not virtual:
        out.print(f"lateness of the ticks: {result.jitter.text}, {result.outcome.skipped} left out")
    out.print(f"{result.outcome.rows} rows: {result.recording}")
    if result.recording is not None:
        out.print(f"next: hil {'compare' if result.complete else 'scope'} {shlex.quote(str(result.recording))}")
