"""hil demo."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.report.console import err, out, progress, table

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench
    from hil.bench.hardware import SimulatedEffect, SimulationSection
    from hil.diagnosis.result import Result
    from hil.motion.profile import Profile
    from hil.motion.trajectory import Trajectory
    from hil.recording.recording import Recording


def demo(
    effect: Annotated[str | None, typer.Option(help="Effect to conceal, such as backlash; default: drawn")] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed of the draw and of the simulated sensors; default: another one every time"),
    ] = None,
    virtual: Annotated[bool, typer.Option("--virtual", help="In virtual time")] = False,
    folder: Annotated[
        Path | None, typer.Option("--out", help="New folder for recordings and reports; default: runs/demo-TIME")
    ] = None,
) -> None:
    """Conceal an effect in the simulated axis, move it over CANopen, compare it with its twin, and find the effect."""
    import secrets

    from hil.commands.warm_up import compile_kernels
    from hil.files.optional_library import missing_of, page_line
    from hil.files.output import default_folder, new_folder
    from hil.files.shipped import shipped_files
    from hil.loop.simulated_bench import load_simulated
    from hil.validation.proof.draw import demo as concealed

    folder = folder or default_folder("demo")
    seed = secrets.randbelow(10_000) if seed is None else seed
    believed = load_simulated("reference")
    bench, truth = concealed.conceal(believed, seed, effect)
    compile_kernels()
    err.print("A simulated ball-screw axis conceals an effect that neither its twin nor the diagnosis knows.")
    # imported late: these take seconds
    from hil.diagnosis.diagnose import diagnose
    from hil.identification.compare import compare
    from hil.report.compare_report import rows_of, write_comparison
    from hil.report.diagnosis_report import write_diagnosis

    with new_folder(folder) as part:
        learn, prove = _record(bench, part, virtual)
        with progress() as tell:
            comparison = compare(learn, believed, progress=tell)
        table(("measured - twin of the bench file", "rms", "largest", "relative"), rows_of(comparison))
        out.print(f"\n{comparison.statement}\n")
        with progress() as tell:
            diagnosis = diagnose([learn], [prove], believed, lambda text: tell(text, None))
        out.print(f"Diagnosis: {diagnosis.result.statement}\n")
        _say(diagnosis.result, truth, believed)
        with progress() as tell:  # pages last: their libraries take seconds to load
            tell("writing the reports", None)
            write_comparison(comparison, part)
            write_diagnosis(diagnosis, part, bench_file=shipped_files("bench")["reference"], machine=truth)
    out.print(f"\nThe same again: hil demo --seed {seed}" + (f" --effect {effect}" if effect else ""))
    if missing_of("report"):
        out.print(page_line(folder))
        return
    out.print(
        "Open these files in a browser:"
        f"\n  the difference: {(folder / 'compare.html').resolve()}"
        f"\n  its cause:      {(folder / 'report.html').resolve()}"
    )


def _record(bench: Bench, folder: Path, virtual: bool) -> list[Recording]:
    """Record the two runs of the demo; in virtual time if the machine does not keep wall-clock time."""
    from hil.errors import HilError, InputError, StillPowered, StoppedByUser
    from hil.validation.proof.draw.demo import LEARN, PROVE

    recordings = []
    for name, profile in (("learn", LEARN), ("prove", PROVE)):
        try:
            recordings.append(_run(bench, profile, folder, name, virtual))
        except (InputError, StillPowered, StoppedByUser):
            raise
        except HilError as why:
            if virtual:
                raise
            err.print(f"Failed in wall-clock time, as on a busy machine: {why}\nThe same moves again in virtual time.")
            virtual = True
            recordings.append(_run(bench, profile, folder, name, virtual))
    return recordings


def _run(bench: Bench, profile: Profile, folder: Path, name: str, virtual: bool) -> Recording:
    """Return the recording. Raises HilError if the machine gave none that is worth reading."""
    from hil.errors import HilError, StoppedByUser
    from hil.loop.run import run_profile
    from hil.recording.recording import read_recording

    def planned(trajectory: Trajectory) -> None:
        err.print(
            f"{trajectory.duration_s:.1f} s over the simulated CANopen bus, once kernels are compiled: "
            f"{profile.description} ..."
        )

    # a late tick harms nothing on a simulated bench: a busy machine is reported, not refused
    result = run_profile(bench, profile, folder, name, virtual=virtual, force=True, planned=planned)
    outcome = result.outcome
    stopped = f"stopped: {outcome.ending}: {outcome.reason}"
    if outcome.stop_asked:
        raise StoppedByUser(stopped)
    if not virtual:
        out.print(f"lateness of the ticks: {result.jitter.text}")
    if not result.complete or result.recording is None:
        raise HilError(stopped)
    if outcome.skipped:  # their rows are interpolated, and the control law cannot be replayed on them
        raise HilError(f"the loop was late and left out {outcome.skipped} of {outcome.rows} ticks")
    return read_recording(result.recording)


def _say(result: Result, truth: SimulationSection, believed: Bench) -> None:
    """Print the concealed effect beside the finding."""
    import math

    from hil.diagnosis.wording import named, title
    from hil.quantities import digits, quantity, unit_of
    from hil.twin.library import BY_ID
    from hil.twin.parameter import Role

    (hidden,) = truth.effects
    found = next((finding for finding in result.missing if finding.effect == hidden.effect), None)
    parameters = {parameter.name: parameter for parameter in BY_ID[hidden.effect].parameters}
    rows = []
    for name, value in hidden.parameters.items():
        true = math.remainder(value, 2.0 * math.pi) if parameters[name].role is Role.PHASE else value
        unit, seen = parameters[name].dimension.unit(), found.parameters[name] if found else None
        told = [quantity(one, unit) for one in (seen.value, seen.std)] if seen else ["–", "–"]
        rows.append((name, "–", quantity(true, unit), *told))
    for name, value in truth.axis.items():
        unit, fitted = unit_of(name), result.parameter_corrections.get(name)
        told = [f"{digits(one)} {unit}" for one in (fitted.value, fitted.std)] if fitted else ["–", "–"]
        rows.append((name, f"{digits(getattr(believed.axis, name))} {unit}", f"{digits(value)} {unit}", *told))
    table((title(hidden.effect), "bench file", "concealed", "found", "standard error"), rows)
    names = " and ".join(named(finding) for finding in result.missing) or title(result.verdict)
    out.print(
        f"\nConcealed: [bold]{title(hidden.effect)}[/bold]; found: [bold]{names}[/bold]. {_judged(result, hidden)}",
        markup=True,
    )


def _judged(result: Result, hidden: SimulatedEffect) -> str:
    named = [finding.effect for finding in result.missing]
    if named == [hidden.effect]:
        return "[green]It found what was concealed.[/green]"
    if hidden.effect in named:
        return "[yellow]What was concealed is among what it found.[/yellow]"
    if any(hidden.effect in finding.equivalents for finding in result.missing):
        return "[yellow]It says that these moves cannot tell the two apart.[/yellow]"
    return "[red]It did not find it.[/red]"
