"""hil fleet."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.report.console import err, out, progress, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.fleet.fleet import Fleet
    from hil.fleet.store import Row


class FleetStage(StrEnum):
    """What is done with the recordings of a fleet."""

    INDEX = "index"
    COMPARE = "compare"
    TREND = "trend"
    DIAGNOSE = "diagnose"


def fleet(
    what: Annotated[
        FleetStage,
        typer.Argument(
            help="index: look at all recordings. compare: and tell the condition by each. trend: changes over months, "
            "pages. diagnose: in full what the trend points at."
        ),
    ],
    folder: Annotated[
        str,
        typer.Argument(
            metavar="FOLDER",
            help="Folder or URL of the fleet: FOLDER/AXIS/ has the recordings of an axis, their date in the metadata "
            "or the name, bench.yaml, and if needed map.yaml and service.csv.",
        ),
    ],
    results: Annotated[
        str | None, typer.Option("--out", help="Folder or URL of the results. Default: FOLDER/_fleet.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="diagnose: every recording that is compared.")] = False,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Workers that are started here. Default: cores.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            help="Address of a dask scheduler in place of own workers, as tls://10.0.0.1:8786; its workers reach the "
            "same folders. Whoever reaches it executes code as its user: give it TLS, or a network that you trust.",
        ),
    ] = None,
    tls: Annotated[
        Path | None, typer.Option("--tls", help="Folder with ca.pem, cert.pem, key.pem for a scheduler at tls://.")
    ] = None,
) -> None:
    """Watch a fleet: condition of many axes by their recordings, changes over months, which axis needs a look first.

    Call it again to go on after an end of any kind: what is done is kept, what is new is added.
    """
    import os
    from contextlib import ExitStack
    from functools import cache

    from hil.commands.warm_up import compile_kernels
    from hil.errors import InputError
    from hil.files.optional_library import missing_of, pip_install
    from hil.workers.cluster import cluster, own_cluster

    if missing := missing_of("fleet"):
        raise InputError(f"hil fleet needs {' and '.join(missing)}, which is not installed: {pip_install('fleet')}")
    from hil.fleet.engine import Engine
    from hil.fleet.fleet import Fleet
    from hil.fleet.store import RESULTS, Store

    if every and what is not FleetStage.DIAGNOSE:
        raise InputError(f"--all: given with {what}, allowed with diagnose")
    if tls is not None and scheduler is None:
        raise InputError("--tls: given without --scheduler, allowed with the address of one, tls://HOST:8786")
    recordings = Store(folder)
    place = Store(results) if results else recordings.within(RESULTS)
    compile_kernels(of_loop=False)
    with ExitStack() as stack, progress() as tell:
        count = workers or len(os.sched_getaffinity(0))
        connect = cache(lambda: stack.enter_context(cluster(scheduler, tls) if scheduler else own_cluster(count)))
        last = [0.0]

        def told(stage: str, done: int, of: int, left_s: float) -> None:
            tell(stage, done / max(of, 1))
            if not err.is_terminal and done - last[0] >= 0.1 * of:
                last[0] = done
                err.print(f"{stage}: {done} of {of}, about {_time(left_s)} left")
            last[0] = 0.0 if done >= of else last[0]

        one = Fleet(recordings, Engine(place, connect, told))
        rows = _do(one, what, every)
    bad = [row for row in rows if row["status"] != "good"]
    for row in bad[:20]:
        err.print(f"Left out: {row['reason'] if row['file'] in row['reason'] else _told(row)}")
    if len(bad) > 20:
        err.print(f"and {len(bad) - 20} more")
    _print(what, rows, one)


def _do(fleet: Fleet, what: FleetStage, every: bool) -> Sequence[Row]:
    from hil.fleet.fleet import CONDITION

    if what is FleetStage.INDEX:
        return fleet.index()
    if what is FleetStage.COMPARE:
        return fleet.compare()
    if what is FleetStage.TREND:
        return fleet.trend()
    compared = [row["file"] for row in fleet.results.rows(CONDITION) if row["status"] == "good"]
    return fleet.diagnose(compared if every else fleet.pointed_at())


def _print(what: FleetStage, rows: Sequence[Row], fleet: Fleet) -> None:
    from hil.files.optional_library import page_line
    from hil.fleet.fleet import PAGE
    from hil.quantities import digits

    good = [row for row in rows if row["status"] == "good"]
    if what is FleetStage.TREND:
        first = sorted(good, key=lambda row: (-row["need"], row["axis"]))[:20]
        table(
            ("axis", "need", "why"), [(row["axis"], digits(row["need"], 2), row["why"]) for row in first], right=False
        )
        page = fleet.results.local
        out.print(f"\n{page_line(page / PAGE) if page else f'Report: {fleet.results.url}/{PAGE}'}")
    elif what is FleetStage.DIAGNOSE:
        table(
            ("recording", "verdict", "statement"),
            [(row["file"], row["verdict"], row["statement"]) for row in good],
            right=False,
        )
        out.print("\nhil fleet trend links them from the pages of their axes.")
    else:
        axes = len({row["axis"] for row in good})
        out.print(f"good recordings: {len(good)} of {axes} axes; bad: {len(rows) - len(good)}")


def _told(row: Row) -> str:
    """File and reason of a row whose reason names the recording alone, if anything."""
    name, reason = row["file"] or row["axis"], str(row["reason"])
    return f"{name}: {reason.removeprefix(f'{Path(name).stem}: ').removeprefix(f'{Path(name).name}: ')}"


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
