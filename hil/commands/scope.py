"""hil scope."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.report.console import err, out

SCOPE_PORT = 8765


def scope(
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            help="One recording, or two over each other. Default: the run that goes on.", show_default=False
        ),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen at. Any but this computer's own asks for a token.")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free one.")] = SCOPE_PORT,
    folder: Annotated[Path, typer.Option("--out", help="Folder for what is saved.")] = Path("runs"),
    within: Annotated[
        Path | None, typer.Option(help="Only runs that are recorded in this folder. Default: the newest one of all.")
    ] = None,
    beside: Annotated[
        int | None, typer.Option(min=1, help="End when this process has ended and no page is open any more.")
    ] = None,
) -> None:
    """Show a run as it goes on, or recordings, in a browser. It only reads: no page has a way to the axis."""
    import os
    import secrets
    import sys

    from hil.commands.runs import read_run
    from hil.errors import InputError
    from hil.scope.live import LiveRing
    from hil.scope.page_session import PageSession
    from hil.scope.rows import FixedRows
    from hil.scope.server import ScopeServer, address, bound, is_loopback, serve

    given = recordings or []
    if len(given) > 2:
        raise InputError(f"given {len(given)} recordings, allowed one or two")
    shown = [FixedRows.of_recording(read_run(path)) for path in given]
    own = is_loopback(host)
    token = "" if own else secrets.token_urlsafe(16)
    live = None if shown else LiveRing(within).rows

    def make_session(page: str) -> PageSession:
        return PageSession(live, shown, {"page": page, "saves": own})

    listening = bound(host, port)
    os.nice(10)  # a scope gives way to all else
    out.print(f"scope: {address(listening, token)}")
    sys.stdout.flush()  # also where it is read by another program
    if beside is None:
        err.print("ctrl-C ends it")
    serve(ScopeServer(make_session, folder if own else None, token), listening, beside)
