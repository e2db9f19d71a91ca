"""Options and arguments that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

RunBench = Annotated[str, typer.Option(help="Bench file or name of a shipped bench.")]
RecordedBench = Annotated[
    str | None,
    typer.Option(help="Bench file or name of a shipped bench. Default: the bench stored in the recording."),
]
Virtual = Annotated[
    bool, typer.Option("--virtual/--wall", help="Simulated bench: run as fast as possible or in wall-clock time.")
]
Force = Annotated[
    bool, typer.Option("--force", help="Run although jitter, bus load or the drive's watchdog forbid it.")
]
ResetFault = Annotated[
    bool, typer.Option("--reset-fault", help="Reset the fault that the drive has latched, after its cause is removed.")
]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of the simulated sensors. Default: the bench's seed.")]
Out = Annotated[Path | None, typer.Option("--out", help="Folder for the results. Default: a new one in runs/.")]
Rate = Annotated[
    float | None,
    typer.Option("--rate", min=0.1, help="Rows per second, for a file without time stamps.", show_default=False),
]
Readme = Annotated[
    Path | None,
    typer.Option(
        "--readme",
        help="Text of the owner that tells what the file does not: lead, counts, torque constant, units.",
        show_default=False,
    ),
]
AxisInNames = Annotated[
    str | None,
    typer.Option(
        "--axis",
        help="Number or letter of the axis in the names of columns, of a file with several.",
        show_default=False,
    ),
]
