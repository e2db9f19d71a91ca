"""hil export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.runs import read_run
from hil.report.console import out


def export(
    recording: Annotated[Path, typer.Argument(help="Recording (.parquet, .arrows, .csv).", show_default=False)],
    target: Annotated[
        Path,
        typer.Option("--out", help="File to write; its ending says the format: .mf4, .mcap, .csv, .mat, .h5 or .hdf5."),
    ],
    plotjuggler: Annotated[
        bool, typer.Option("--plotjuggler", help="Write a layout for PlotJuggler beside it: NAME-layout.xml.")
    ] = False,
) -> None:
    """Write a recording for other tools: channels, units and metadata. `hil import` reads it back without a map."""
    from hil.exchange.export import export_recording, refuse_existing
    from hil.exchange.plotjuggler import layout_path, write_layout

    if plotjuggler:
        refuse_existing(layout_path(target))
    read = read_run(recording)
    paths = export_recording(read, target)
    if plotjuggler:
        paths += (write_layout(target, read.axis, read.columns),)
    for path in paths:
        out.print(f"Export: {path}")
