"""One line in the terminal for a run that goes on, by a process of its own that reads the ring; see `hil run`.

python -m hil.scope.status_line FOLDER      # of the recording; standard input ends when the line shall vanish
"""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.text import Text

from hil.quantities import quantity
from hil.scope.live import LiveRing
from hil.scope.rows import ScopeRows
from hil.scope.status import status
from hil.scope.traces import Trace, traces_of

EVERY_S = 0.2
SHOWN = (("position", "measured"), ("following error", ""), ("torque", "measured"), ("force", "measured"))


def line(told: Mapping[str, Any], traces: Mapping[str, Trace]) -> str:
    """Return per cent, position, following error, torque or force, and state, of what `status` told."""
    parts = []
    if told.get("progress") is not None:
        parts.append(f"{100.0 * told['progress']:3.0f} %")
    newest = told.get("newest", {})
    for panel, role in (
        ("position", "measured"),
        ("following error", ""),
        ("torque", "measured"),
        ("force", "measured"),
    ):
        named = (one for one in traces.values() if one.panel == panel and one.role.startswith(role))
        if (trace := next(named, None)) is not None and trace.name in newest:
            parts.append(f"{panel} {quantity(newest[trace.name], trace.unit)}")
    parts.append(told["state"] + (", stopping" if told.get("stopping") else ""))
    return "  ".join(parts + ([told["fault"]] if told.get("fault") else []))


def main() -> None:
    """Show the line until standard input ends or the run does."""
    os.nice(10)
    live, rows, traces = LiveRing(Path(sys.argv[1])), None, dict[str, Trace]()
    text = Text(no_wrap=True, overflow="ellipsis")
    with Live(text, console=Console(stderr=True, highlight=False), auto_refresh=False, transient=True) as view:
        while not select.select([sys.stdin], [], [], EVERY_S)[0]:
            found: ScopeRows | None = live.rows()
            if found is None:
                continue
            if rows is None:
                rows, traces = found, traces_of(found.channels, found.metadata)
            text.plain = line(status(rows, traces), traces)
            view.refresh()
            if rows.ended:
                return


if __name__ == "__main__":
    with suppress(OSError):  # a terminal that is closed
        main()
