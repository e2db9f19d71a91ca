"""hil import."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.commands.options import AxisInNames, Rate, Readme
from hil.report.console import err, out

if TYPE_CHECKING:
    from hil.importing.readme import FileHints
    from hil.recording.recording import Recording


def import_(
    source: Annotated[
        Path,
        typer.Argument(
            help="Foreign recording: text such as .csv, .mat, .npy, .npz, .mf4, .mcap, .h5, .tdms, .ulg, .xml, .json, "
            ".parquet; or a file of hil export.",
            show_default=False,
        ),
    ],
    map_file: Annotated[
        str | None,
        typer.Option(
            "--map",
            help="Map of columns and units (YAML), or name of a shipped map: emps. Default: a map is drafted from "
            "the file and written beside the result.",
            show_default=False,
        ),
    ] = None,
    target: Annotated[
        Path | None,
        typer.Option("--out", help="Parquet file to write. Default: the name of the source, in this folder."),
    ] = None,
    rate_hz: Rate = None,
    axis: AxisInNames = None,
    readme: Readme = None,
    bench: Annotated[
        str | None,
        typer.Option(
            help="Bench file or name of a shipped bench, for the log of its CAN bus: .blf, .asc or .log.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Convert a foreign recording to Parquet by a map of its columns, units and signs, or draft this map."""
    from hil.errors import InputError
    from hil.importing.by_map import import_recording
    from hil.importing.readme import FileHints
    from hil.recording.recording import CLOCK_NOTES, write_parquet

    target = target or Path(f"{source.stem}.parquet")
    told = FileHints(rate_hz, axis, readme)
    if map_file is None and not told.options:
        known = _without_a_map(source, bench)
        if known is not None:
            write_parquet(known, target)
            out.print(f"{len(known)} rows, {known.period_s:g} s each\nRecording: {target}")
            return
    elif bench is not None:
        raise InputError(
            "import: given --bench and --map, --rate, --axis or --readme, allowed one of them; leave the others out"
        )
    drafted = map_file is None
    if map_file is None:
        map_file = str(_drafted(source, target, told))
    elif told.options:
        raise InputError(
            f"import: given --map and {told.options[0]}, allowed only without a map; write it into the map"
        )
    recording = import_recording(source, map_file)
    write_parquet(recording, target)
    out.print(f"{len(recording)} rows, {recording.metadata['clock']}")
    if not drafted:  # a draft has said it
        for note in recording.metadata.get(CLOCK_NOTES, []):
            err.print(f"  {note}", markup=False)
    for channel, origin in recording.metadata["channels"].items():
        out.print(
            f"  {channel} = {origin['factor']:.9g} x {origin['column']}"
            + (f" + {origin['offset']:g}" if origin["offset"] else ""),
        )
    for channel, how in recording.metadata["derived"].items():
        out.print(f"  {channel}: {how}")
    out.print(f"Recording: {target}")


def _without_a_map(source: Path, bench: str | None) -> Recording | None:
    """The recording of a file that needs no map: the log of a bus, an exported one; None for another one."""
    from hil.errors import InputError
    from hil.exchange.bus_log import import_bus_log
    from hil.exchange.own_file import read_exported

    if bench is not None:
        from hil.bench.bench_file import load_bench

        return import_bus_log(source, load_bench(bench))
    if source.suffix.lower() == ".blf":
        raise InputError(f"{source}: is the log of a CAN bus; say whose: hil import {source} --bench BENCH")
    return read_exported(source)


def _drafted(source: Path, target: Path, told: FileHints) -> Path:
    """Draft a map beside the recording to write; return its path. Raises InputError: the user must complete it."""
    from hil.errors import InputError, listed
    from hil.files.input_file import is_file
    from hil.files.output import write_text
    from hil.importing.draft_map import draft_map
    from hil.importing.map_text import asked_lines, map_text

    path = target.with_name(f"{target.stem}-map.yaml")
    if is_file(path):
        raise InputError(f"{path}: the map exists and is not overwritten; import with --map {path}, or remove it")
    draft = draft_map(source, *told)
    text = map_text(draft)
    write_text(path, text)
    out.print(f"Map: {path}")
    if draft.unsure:
        err.print("Please check in the map:")
        for note in draft.unsure:
            err.print(f"  - {note}", markup=False)
    if draft.left_out:
        err.print(f"Not used, with reasons at the end of the map: {listed(draft.left_out)}", markup=False)
    if draft.asked:
        questions = [f"{path}:{line}: {question}" for line, question in asked_lines(text)]
        to = [] if target == Path(f"{source.stem}.parquet") else ["--out", str(target)]
        command = shlex.join(["hil", "import", str(source), "--map", str(path), *to])
        what = f"{source}: the file does not tell what follows; write it into the map, then: {command}"
        raise InputError("\n".join([what, *questions]))
    return path
