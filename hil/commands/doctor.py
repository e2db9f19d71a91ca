"""hil doctor."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from hil.report.console import out

if TYPE_CHECKING:
    from hil.loop.machine import MachineFinding


def doctor(as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False) -> None:
    """Say what to change on this PC for a punctual loop, with the commands, and what is fine.

    Exit code 0: nothing has to be changed (there may be advice); 1: something has.
    """
    import json

    from hil.loop.machine import Level

    findings = list(_findings())
    if as_json:
        print(json.dumps({"schema_version": 1, "findings": [one._asdict() for one in findings]}, indent=2))
    else:
        for finding in findings:
            out.print(f"{finding.level:7} {finding.subject}: {finding.state}")
            out.print(textwrap.fill(finding.why, 100, initial_indent=" " * 8, subsequent_indent=" " * 8))
            if finding.command:
                out.print(f"     -> {finding.command}")
        count = {level: sum(finding.level is level for finding in findings) for level in Level}
        out.print(f"\n{count[Level.CHANGE]} to change, {count[Level.ADVICE]} advised, {count[Level.FINE]} fine; "
                  "hil latency measures what it amounts to")  # fmt: skip
    if any(finding.level is Level.CHANGE for finding in findings):
        raise typer.Exit(1)


def _findings() -> Iterator[MachineFinding]:
    from hil.commands.warm_up import kernels_are_compiled
    from hil.loop.can_interfaces import can_findings
    from hil.loop.machine import Level, Machine, MachineFinding, grant_findings, limits_now
    from hil.loop.realtime import real_time

    yield from Machine().findings()
    with real_time() as grants:
        pass
    yield MachineFinding(Level.FINE, "limits of this user", limits_now(), "real-time priority and locked memory")
    yield from grant_findings(grants)
    yield from can_findings()
    compiled = kernels_are_compiled()
    yield MachineFinding(
        Level.FINE if compiled else Level.CHANGE,
        "compiled kernels",
        "all in the cache" if compiled else "none, or of another version",
        "else the first run compiles them, a minute",
        "" if compiled else "hil warm-up",
    )
