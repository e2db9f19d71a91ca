"""hil bench."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hil.report.console import Progress, out, progress, table

if TYPE_CHECKING:
    from hil.validation.benchmarks.figure import Figure


def bench(
    file: Annotated[Path, typer.Option("--out", help="JSON file for the figures.")] = Path("runs/bench.json"),
    against: Annotated[
        Path | None, typer.Option(help="--out file of an earlier run; its figures stand beside the new ones.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON instead of tables.")] = False,
) -> None:
    """Measure loop, simulated bench, twin and a diagnosis on this machine, beside other tools and its limits."""
    from hil.commands.warm_up import compile_kernels
    from hil.files.output import write_json
    from hil.loop.realtime import machine_state, measure_jitter, now_text, real_time
    from hil.validation.benchmarks import diagnosis_stages, summary

    earlier = None if against is None else summary.read_earlier(against)
    compile_kernels()
    with progress() as tell, real_time() as grants:
        figures = list(_figures(tell))
        tell("jitter of an empty loop", None)
        jitter = measure_jitter(0.001, 5.0)
    with progress() as tell:  # with all cores and an ordinary priority, as a diagnosis has
        tell("stages of a diagnosis", None)
        figures += diagnosis_stages.figures()
    data: dict[str, Any] = {
        "schema_version": 1,
        "time": now_text(),
        "machine": machine_state(),
        "granted": [grant.setting for grant in grants if not grant.refused],
        "refused": [f"{grant.setting} ({grant.refused})" for grant in grants if grant.refused],
        "jitter": vars(jitter),
        "figures": summary.as_data(figures),
    }
    if earlier is not None:
        data["against"] = {"file": str(against), "figures": summary.against(figures, earlier)}
    file.parent.mkdir(parents=True, exist_ok=True)
    write_json(file, data)
    if as_json:
        out.print(file.read_text(encoding="utf-8"), end="")
        return
    table(summary.HEADERS, summary.rows(figures))
    out.print("\n" + "\n".join(summary.notes(figures)))
    if earlier is not None:
        out.print(f"\nAgainst {against} (ratio above 1: faster now)\n")
        table(summary.AGAINST_HEADERS, summary.against_rows(data["against"]["figures"]))
    granted, refused = ", ".join(data["granted"]), ", ".join(data["refused"]) or "nothing"
    texts = (
        f"empty 1 kHz loop, lateness: {jitter.text}",
        "machine: " + ", ".join(f"{name} {value}" for name, value in data["machine"].items()),
        f"granted: {granted}; refused: {refused}",
    )
    out.print("\n" + "\n".join(summary.wrapped(text) for text in texts))
    out.print(f"\nFigures: {file}")


def _figures(tell: Progress) -> Iterator[Figure]:
    from hil.validation.benchmarks import cycle, peers, simulation

    for what, measure in (
        ("whole cycle of the loop", cycle.figures),
        ("simulation", simulation.figures),
        ("other simulators", peers.figures),
    ):
        tell(what, None)
        yield from measure()
