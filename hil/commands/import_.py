"""hil import."""

from pathlib import Path
from typing import Annotated

import typer

from hil.report.console import out


def import_(
    source: Annotated[Path, typer.Argument(help="Foreign recording: .csv, .mat or .parquet.", show_default=False)],
    map_file: Annotated[
        str,
        typer.Option(
            "--map", help="Map of columns and units (YAML), or name of a shipped map: emps.", show_default=False
        ),
    ],
    target: Annotated[
        Path | None,
        typer.Option("--out", help="Parquet file to write. Default: the name of the source, in this folder."),
    ] = None,
) -> None:
    """Convert a foreign recording to Parquet by a map of its columns, units and signs."""
    from hil.recording.importing import import_recording
    from hil.recording.recording import write_parquet

    recording = import_recording(source, map_file)
    target = target or Path(f"{source.stem}.parquet")
    write_parquet(recording, target)
    out.print(f"{len(recording)} rows, {recording.metadata['clock']}")
    for channel, origin in recording.metadata["channels"].items():
        out.print(
            f"  {channel} = {origin['factor']:.9g} x {origin['column']}"
            + (f" + {origin['offset']:g}" if origin["offset"] else ""),
        )
    for channel, how in recording.metadata["derived"].items():
        out.print(f"  {channel}: {how}")
    out.print(f"Recording: {target}")
