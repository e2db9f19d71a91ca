"""hil compensate."""

from pathlib import Path
from typing import Annotated

import typer

from hil.compensating.controllers import Controller
from hil.report.console import out, table


def compensate(
    bench: Annotated[
        Path, typer.Argument(help="bench.diagnosed.yaml, or the folder of a diagnosis.", show_default=False)
    ],
    profile: Annotated[
        Path, typer.Option(help="Motion for which the tables are made and on which the gain is predicted.")
    ],
    target: Annotated[
        Path | None,
        typer.Option("--out", help="Bench file to write. Default: the name of the bench, .compensated.yaml"),
    ] = None,
    fade_in_s: Annotated[
        float, typer.Option("--fade-in", min=0.0, help="Time in which the compensation fades in [s].")
    ] = 1.0,
    controllers: Annotated[
        list[Controller] | None,
        typer.Option("--for", help="Write the tables for this controller too, beside the bench file; repeatable."),
    ] = None,
    tuned: Annotated[
        bool, typer.Option("--tune", help="Take the proposed gains of both loops too; the tables are made for them.")
    ] = False,
) -> None:
    """Turn a diagnosis into a compensation: tables, the gain that they promise, and the bench file that has them."""
    from datetime import date

    from hil.bench.bench_file import Bench, load_bench
    from hil.bench.hardware import DriveMode
    from hil.commands.warm_up import compile_kernels
    from hil.compensating.compensate import DRAWS, plan_compensation, section_of, taken_by_drive
    from hil.compensating.controllers.write_controllers import controller_files, write_files
    from hil.compensating.derive import size
    from hil.compensating.loop_tuning import HEADERS, UNCHANGED, margin_rows, tune
    from hil.compensating.prediction import drawn_benches, predict
    from hil.control.compensation_tables import OFF, Adds
    from hil.diagnosis.result import Result
    from hil.errors import HilError, InputError
    from hil.files.input_file import is_file
    from hil.motion.profile import load_profile
    from hil.motion.trajectory import plan
    from hil.quantities import quantity
    from hil.report.compare_report import write_bench

    path = bench / "bench.diagnosed.yaml" if bench.is_dir() else bench
    diagnosed = load_bench(path)
    target = target or path.with_name(f"{path.stem.removesuffix('.diagnosed')}.compensated.yaml")
    if is_file(target):
        raise InputError(f"{target}: the file exists and is not overwritten; give another name with --out or remove it")
    found = path.with_name("diagnosis.json")
    result = Result.model_validate_json(found.read_text(encoding="utf-8")) if is_file(found) else None
    motion = plan(load_profile(profile), diagnosed.period_s)
    compile_kernels(of_loop=False)
    drawn = tuple(drawn_benches(diagnosed, result, DRAWS)) if result is not None else ()
    loops = tune(diagnosed, drawn)
    table(HEADERS, margin_rows(loops, diagnosed.axis.drive_unit), right=False)
    out.print(UNCHANGED)
    if tuned:
        proposals = [one for one in loops[1:] if one.notch is None]
        if not proposals:
            raise HilError("nothing written: no gains keep both loops stable on this axis and its draws")
        proposed = diagnosed.known_control.with_gains(proposals[0].gains)
        given, diagnosed = diagnosed, diagnosed.model_copy(update={"control": proposed})
        errors = [predict(one, motion, OFF, fade_in_s).following_m for one in (given, diagnosed)]
        unit = "rad" if diagnosed.axis.turns else "m"
        told = " -> ".join(quantity(one, unit) for one in errors)
        out.print(f"Predicted following error, rms, by the gains alone: {told}")
        if min(loops[0].least) > 0.0 and not errors[1] < errors[0]:
            raise HilError(f"refused, nothing written: the proposed gains do not follow this motion better ({told})")
        if given.drive is not None and given.drive.mode is not DriveMode.CST:
            out.print("The drive closes loops of its own: set their gains there too.")
    made = plan_compensation(diagnosed, motion, result, fade_in_s)
    taken, not_taken = taken_by_drive(diagnosed, made)
    if not taken.compensation.tables and not controllers:
        raise HilError(f"nothing written: {'; '.join(f'{name}: {why}' for name, why in not_taken)}; see --for")
    section = section_of(taken, path, date.today().isoformat())
    compensated = Bench.model_validate(diagnosed.model_dump(mode="json") | {"compensation": section})
    units = {Adds.TORQUE: diagnosed.axis.drive_unit, Adds.POSITION: "rad" if diagnosed.axis.turns else "m"}
    rows = []
    for one in made.compensation.tables:
        unit, error = units[one.adds], made.errors.get(one.name)
        amount = quantity(size(one), unit) + (f" ± {quantity(error, unit)}" if error is not None else "")
        of = "positioning" if one.adds is Adds.POSITION else "following"
        before, after = made.gain.before.of(one.adds), made.alone[one.name].of(one.adds)
        position = units[Adds.POSITION]
        sources = ", ".join(made.derived.sources[one.name])
        rows.append((one.name, sources, amount, f"{of} {quantity(before, position)}", quantity(after, position)))
    table(("entry", "source", "largest value", "predicted rms before", "with it alone"), rows, right=False)
    for effect, reason in made.derived.left_out:
        out.print(f"Not compensated: {effect}: {reason}.")
    for name, index in (("following", 0), ("positioning", 1)):
        before, after = made.gain.before[index], made.gain.after[index]
        draws = [drawn[index] for _, drawn in made.gain.draws]
        spread = f" ({quantity(min(draws), position)} to {quantity(max(draws), position)})" if draws else ""
        out.print(f"Predicted {name} error, rms: {quantity(before, position)} -> {quantity(after, position)}{spread}")
    if result is None:
        out.print("No diagnosis.json beside the bench: the prediction has no interval.")
    if made.harms:
        raise HilError(f"refused, nothing written: {'; '.join(made.harms)}")
    files = controller_files(controllers or (), diagnosed, made.compensation, motion, target)
    written = write_files(files.values(), target)
    write_bench(compensated, target)
    for controller, made_for in files.items():
        for name, reason in made_for.not_taken:
            out.print(f"Not for {controller}: {name}: {reason}.")
    for name, reason in not_taken:
        out.print(f"Not in the bench file: {name}: {reason}.")
    for path in written:
        out.print(f"Table: {path}")
    out.print(f"Bench: {target}; off by `compensation: enabled: false`")
