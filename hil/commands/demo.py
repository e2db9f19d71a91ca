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
    from hil.recording.recording import Recording


def demo(
    effect: Annotated[str | None, typer.Option(help="What to conceal, such as backlash; left out: drawn")] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Of what is drawn and of the simulated sensors; left out: another one every time"),
    ] = None,
    virtual: Annotated[bool, typer.Option("--virtual", help="In virtual time")] = False,
    folder: Annotated[
        Path | None, typer.Option("--out", help="New folder for recordings and reports; left out: runs/demo-TIME")
    ] = None,
) -> None:
    """Conceal an effect in the simulated axis, move it over CANopen, compare it with its twin, and find the effect."""
    import secrets

    from hil import demo as concealed
    from hil.files.output import default_folder, new_folder
    from hil.loop.simulated_bench import load_simulated

    folder = folder or default_folder("demo")
    seed = secrets.randbelow(10_000) if seed is None else seed
    believed = load_simulated("reference")
    bench, truth = concealed.conceal(believed, seed, effect)
    err.print("A simulated ball-screw axis conceals something that neither its twin nor the diagnosis knows.")
    # only now what takes seconds to import
    from hil.diagnosis.diagnose import diagnose
    from hil.identification.compare import compare
    from hil.report.compare_report import verdict, write_comparison
    from hil.report.diagnosis.report import write_diagnosis
    from hil.report.style import percent, quantity

    with new_folder(folder) as part:
        learn, prove = _record(bench, part, virtual)
        with progress() as tell:
            comparison = compare(learn, believed, progress=tell)
            tell("writing the comparison", None)
            write_comparison(comparison, part)
        table(
            ("measured less twin as the bench file has it", "rms", "largest", "relative"),
            [
                (
                    channel.label,
                    quantity(channel.rms, channel.unit),
                    quantity(channel.peak, channel.unit),
                    percent(channel.relative),
                )
                for channel in comparison.channels
            ],
        )
        out.print(f"\n{verdict(comparison)}\n")
        with progress() as tell:
            diagnosis = diagnose([learn], [prove], believed, lambda text: tell(text, None))
            tell("writing the report", None)
            write_diagnosis(diagnosis, part)
    out.print(f"[bold]Diagnosis[/bold]: {diagnosis.result.statement}\n")
    _say(diagnosis.result, truth, believed)
    out.print(
        f"\nThe same again: hil demo --seed {seed}"
        + (f" --effect {effect}" if effect else "")
        + "\nOpen these files in a browser:"
        f"\n  the difference: {(folder / 'compare.html').resolve()}"
        f"\n  its cause:      {(folder / 'report.html').resolve()}"
    )


def _record(bench: Bench, folder: Path, virtual: bool) -> list[Recording]:
    """The two runs of the demo, recorded."""
    from hil.demo import LEARN, PROVE
    from hil.errors import HilError
    from hil.loop.run import run_profile
    from hil.loop.supervision import Ending
    from hil.recording.recording import read_recording

    recordings = []
    for name, profile in (("learn", LEARN), ("prove", PROVE)):
        # on a simulated bench nothing can be harmed by a late tick: a busy machine is reported, not refused
        result = run_profile(
            bench,
            profile,
            folder,
            name,
            virtual=virtual,
            force=True,
            planned=lambda trajectory, what=profile.description: err.print(  # type: ignore[misc]
                f"{trajectory.duration_s:.1f} s over the simulated CANopen bus, once kernels are compiled: {what} ..."
            ),
        )
        if result.outcome.ending is Ending.OVERRUN:
            err.print("This machine is too busy for wall-clock time; the same moves again in virtual time.")
            virtual = True
            result = run_profile(bench, profile, folder, name, virtual=True)
        if not virtual:
            out.print(f"lateness of the ticks: {result.jitter.text}")
        if not result.complete or result.recording is None:
            raise HilError(f"stopped: {result.outcome.ending}: {result.outcome.reason}")
        recordings.append(read_recording(result.recording))
    return recordings


def _say(result: Result, truth: SimulationSection, believed: Bench) -> None:
    """What was concealed beside what was found."""
    import math

    from hil.diagnosis.wording import NOMINAL_UNITS, number, said, title
    from hil.twin.library import BY_ID
    from hil.twin.mechanism import Role

    (hidden,) = truth.effects
    found = next((finding for finding in result.missing if finding.effect == hidden.effect), None)
    rows = []
    parameters = {parameter.name: parameter for parameter in BY_ID[hidden.effect].parameters}
    for name, value in hidden.parameters.items():
        parameter, seen = parameters[name], found.parameters[name] if found else None
        rows.append(
            (
                name,
                "–",
                said(
                    math.remainder(value, 2.0 * math.pi) if parameter.role is Role.PHASE else value,
                    parameter.dimension,
                ),
                said(seen.value, parameter.dimension) if seen else "–",
                said(seen.std, parameter.dimension) if seen else "–",
            )
        )
    for name, value in truth.axis.items():
        unit, fitted = NOMINAL_UNITS[name], result.parameter_corrections.get(name)
        rows.append(
            (
                name,
                f"{number(getattr(believed.axis, name))} {unit}",
                f"{number(value)} {unit}",
                f"{number(fitted.value)} {unit}" if fitted else "–",
                f"{number(fitted.std)} {unit}" if fitted else "–",
            )
        )
    table((title(hidden.effect), "bench file", "concealed", "found", "standard error"), rows)
    names = " and ".join(title(finding.effect) for finding in result.missing) or title(result.verdict)
    out.print(
        f"\nConcealed: [bold]{title(hidden.effect)}[/bold]; found: [bold]{names}[/bold]. {_judged(result, hidden)}"
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
