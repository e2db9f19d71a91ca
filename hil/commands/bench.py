"""hil bench."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.report.console import Progress, out, progress, table

if TYPE_CHECKING:
    from hil.benchmarks.figure import Figure


def bench(
    file: Annotated[Path, typer.Option("--out", help="JSON file for the figures.")] = Path("runs/bench.json"),
) -> None:
    """Measure loop, simulated bench and twin on this machine, and compare them with other simulators."""
    from hil.commands.warm_up import compile_kernels
    from hil.files.output import write_json
    from hil.loop.realtime import machine_state, measure_jitter, now_text, real_time

    compile_kernels()
    with progress() as tell, real_time() as grants:
        figures = list(_figures(tell))
        tell("jitter of an empty loop", None)
        jitter = measure_jitter(0.001, 5.0)
    table(
        ("figure", "measured", "target", "met", "how"),
        [
            (
                figure.name,
                _number(figure.value, figure.unit),
                _target(figure),
                {True: "yes", False: "no", None: ""}[figure.met],
                figure.detail,
            )
            for figure in figures
        ],
    )
    machine = machine_state()
    granted = [grant.setting for grant in grants if not grant.refused]
    refused = [f"{grant.setting} ({grant.refused})" for grant in grants if grant.refused]
    out.print(f"\nempty 1 kHz loop, lateness: {jitter.text}")
    out.print("machine: " + ", ".join(f"{name} {value}" for name, value in machine.items()), markup=False)
    out.print(f"granted: {', '.join(granted)}; refused: {', '.join(refused) or 'nothing'}", markup=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_json(
        file,
        {
            "schema_version": 1,
            "time": now_text(),
            "machine": machine,
            "granted": granted,
            "refused": refused,
            "jitter": vars(jitter),
            "figures": [
                vars(figure) | {"met": figure.met, "value": None if figure.value != figure.value else figure.value}
                for figure in figures
            ],
        },
    )
    out.print(f"\nFigures: {file}")


def _figures(tell: Progress) -> Iterator[Figure]:
    from hil.benchmarks import cycle, peers, simulation

    for what, measure in (
        ("whole cycle of the loop", cycle.figures),
        ("simulation", simulation.figures),
        ("other simulators", peers.figures),
    ):
        tell(what, None)
        yield from measure()


def _number(value: float, unit: str) -> str:
    if value != value:
        return "-"
    return f"{value:,.0f} {unit}".replace(",", " ") if value >= 100.0 else f"{value:.1f} {unit}"


def _target(figure: Figure) -> str:
    if figure.target is None:
        return ""
    return f"{'≤' if figure.at_most else '≥'} {_number(figure.target, figure.unit)}"
