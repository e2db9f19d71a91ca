"""hil investigate."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.commands.options import Force, Out, RunBench, Seed, Virtual
from hil.report.console import err, out, progress, table

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench
    from hil.loop.run import RunResult
    from hil.motion.profile import Profile


def investigate(
    profiles: Annotated[
        list[Path],
        typer.Argument(
            metavar="PROFILE...", show_default=False, help="First profiles: files or shipped ones: identification."
        ),
    ],
    bench: RunBench = "reference",
    validate: Annotated[
        list[Path] | None,
        typer.Option(
            "--validate",
            help="Profile of another motion, on which the result is validated; may be given several times. "
            "Default: a third of each recording.",
        ),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, max=10, help="Largest number of rounds.")] = 3,
    compensate: Annotated[
        bool,
        typer.Option(
            "--compensate", help="Then compensate what was found, and keep what helps on the motions of --validate."
        ),
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="On a real bench: run designed motions without asking.")] = False,
    virtual: Virtual = False,
    force: Force = False,
    seed: Seed = None,
    folder: Out = None,
) -> None:
    """Run profiles, diagnose them, and run newly designed motions until one cause remains.

    Designed motions stay within the travel and the limits of the recorded set-points and within drive.travel_m of the
    bench. On a real bench each one is shown and must be confirmed.
    """
    from hil.bench.bench_file import Bench, load_bench
    from hil.commands.run import named, say
    from hil.commands.warm_up import compile_kernels
    from hil.compensating.trial import try_compensation
    from hil.compensating.trial_page import HEADERS, rows_of, write_trial
    from hil.diagnosis.wording import title, titles
    from hil.errors import InputError
    from hil.files.optional_library import page_line
    from hil.files.output import default_folder, refuse_used
    from hil.files.shipped import given_or_shipped
    from hil.investigation import investigate as investigate_bench
    from hil.loop.run import run_profile
    from hil.loop.simulated_bench import load_simulated
    from hil.loop.supervision import Ending
    from hil.motion.profile import load_profile
    from hil.report.compare_report import write_bench
    from hil.report.diagnosis_report import write_diagnosis

    if compensate and not validate:
        raise InputError("--compensate: given without --validate, allowed with a motion to measure the gain on")
    files = {path.stem: path for path in (*profiles, *(validate or []))}
    if len(files) < len(profiles) + len(validate or []):
        raise InputError(
            f"PROFILE: given {', '.join(map(str, (*profiles, *(validate or []))))}, allowed files with "
            "names of their own: recordings take their names"
        )
    loaded = load_simulated(bench)
    first, proving = ({path.stem: load_profile(path) for path in paths} for paths in (profiles, validate or []))
    folder = folder or default_folder(f"investigate-{loaded.name}")
    refuse_used(folder)
    simulation = loaded.simulation

    def file_of(name: str, place: Path) -> Path:
        """The profile file of a recording NAME or NAME_label; that of a motion of this investigation is beside it."""
        stems = [stem for stem in files if name == stem or name.startswith(f"{stem}_")]
        return files[max(stems, key=len)] if stems else place / f"{name}.yaml"

    seeds = itertools.count(seed if seed is not None else simulation.seed if simulation else 0)

    def run(profile: Profile, place: Path, name: str, on: Bench = loaded) -> RunResult:
        with named(bench, file_of(name, place)):
            ran = run_profile(
                on,
                profile,
                place,
                name,
                virtual=virtual,
                force=force,
                seed=next(seeds) if simulation else None,  # different noise in every run
                planned=lambda trajectory: err.print(
                    f"{name} on {loaded.name}: {trajectory.duration_s:.1f} s of motion ..."
                ),
            )
        if on is loaded:
            say(ran, virtual)
        else:
            for note in (*ran.notes, *ran.doubts):
                err.print(f"note: {name}: {note}")
        if ran.outcome.ending is Ending.INTERRUPTED:
            raise typer.Exit(130)
        return ran

    def allowed(profile: Profile) -> bool:
        return simulation is not None or yes or _confirmed(profile, loaded)

    compile_kernels()
    found = investigate_bench(first, proving, loaded, folder, run, allowed, progress, rounds)
    with progress() as tell:
        tell("writing the report")
        write_diagnosis(found.diagnosis, folder, bench_file=given_or_shipped(bench, "bench"))
    table(
        ("round", "motion", "found", "open"),
        [
            (
                str(number),
                ", ".join(one.motions),
                titles(finding.effect for finding in one.diagnosis.result.missing)
                or title(one.diagnosis.result.verdict),
                titles(one.open) or "–",
            )
            for number, one in enumerate(found.rounds, 1)
        ],
    )
    out.print(f"\n{found.diagnosis.result.statement}\n\n{found.ended}\n\n{page_line(folder / 'report.html')}")
    if compensate:
        if simulation is None:
            err.print(
                "Each motion of --validate is run twice without a compensation, once with it, once without each table."
            )
        if not all(allowed(profile) for profile in proving.values()):
            out.print("The compensation was not tried: it was not confirmed.")
            return
        with progress() as tell:
            tell("trying the compensation")
            trial = try_compensation(
                loaded,
                found.diagnosis.bench,
                found.diagnosis.result,
                proving,
                folder / "compensation",
                lambda on, profile, place, name: run(profile, place, name, on),
            )
            write_trial(trial, loaded, folder)
        table(HEADERS, rows_of(trial), right=False)
        out.print(f"\n{trial.statement}\n\n{page_line(folder / 'compensation.html')}")
        if trial.section:
            diagnosed = load_bench(folder / "bench.diagnosed.yaml").model_dump(mode="json")
            write_bench(
                Bench.model_validate(diagnosed | {"compensation": trial.section}), folder / "bench.compensated.yaml"
            )
            out.print(f"Bench: {folder / 'bench.compensated.yaml'}")


def _confirmed(profile: Profile, bench: Bench) -> bool:
    """Ask whether a motion may be run on a real axis; False without a terminal."""
    from hil.motion.trajectory import plan
    from hil.quantities import quantity

    if not sys.stdin.isatty():
        return False
    trajectory, limits = plan(profile, bench.gains.period_s), profile.limits
    unit = "rad" if bench.axis.turns else "m"
    places = (quantity(float(one), unit) for one in (trajectory.position_m.min(), trajectory.position_m.max()))
    err.print(
        f"Next motion: {profile.description}, {trajectory.duration_s:.1f} s, from {' to '.join(places)}, up to "
        f"{limits.velocity_m_s:g} {unit}/s, {limits.acceleration_m_s2:g} {unit}/s^2, {limits.jerk_m_s3:g} {unit}/s^3."
    )
    return typer.confirm("Run it on this bench?", default=False, err=True)
