"""hil recover."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.report.console import out


def recover(
    stream: Annotated[
        Path | None, typer.Argument(help="NAME.arrows of a run that was not closed. Default: list those in memory.")
    ] = None,
    to: Annotated[Path | None, typer.Option("--out", help="File to write. Default: NAME.parquet beside it.")] = None,
) -> None:
    """Make a readable recording of a run that was killed, or whose disk was full or damaged; NAME.arrows stays.

    Whole blocks of the file are used, and the rows that are still in memory. Gaps are marked in the recording. Call it
    as the user of the run: rows in memory (/dev/shm/hil-ring-*) are its alone, and root takes them from any user.
    """
    from hil.loop.certificate import of_rows
    from hil.recording.recover import remains, unfinished, write_remains

    if stream is None:
        for left in unfinished():
            out.print(str(left))
        return
    path = to or stream.with_suffix(".parquet")
    if path.suffix != ".parquet":
        from hil.errors import InputError

        raise InputError(f"{path}: given the ending {path.suffix!r} as --out, allowed .parquet; correct it")
    with remains(stream) as found:
        write_remains(found, path, of_rows(dict(zip(found.channels, found.rows.T, strict=True)), found.metadata))
        out.print(f"{path}: {found.text}")
