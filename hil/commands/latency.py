"""hil latency."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from contextlib import nullcontext
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hil.report.console import err, out

if TYPE_CHECKING:
    from hil.loop.latency import Latencies, Series

_BAR = 12  # characters of the longest bar: three columns fit into 80


def latency(
    period: Annotated[
        list[float] | None,
        typer.Option(min=1e-4, max=1.0, help="Period in s, repeatable. Default: 0.004, 0.001 and 0.0005."),
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.1, max=86400.0, help="Duration in s at each period.")] = 10.0,
    busy: Annotated[bool, typer.Option("--load", help="Keep every core busy with an ordinary process.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Measure how late this machine wakes the loop, beside cyclictest; judge it for 250 Hz, 1 kHz and 2 kHz."""
    import json

    from hil.loop import latency as measuring
    from hil.loop.suitability import RATES_HZ, beside, judge

    periods_s = period or [1.0 / rate_hz for rate_hz in RATES_HZ]
    found = []
    with measuring.load() if busy else nullcontext(0) as processes:
        for period_s in periods_s:
            err.print(f"{seconds:g} s at {1.0 / period_s:g} Hz ...")
            found.append(measuring.measure(period_s, seconds))
    judged = [judge(rate_hz, min(found, key=lambda one: abs(math.log(one.period_s * rate_hz)))) for rate_hz in RATES_HZ]
    if as_json:
        data = _as_data(found, processes) | {"rates": [judgement._asdict() for judgement in judged]}
        print(json.dumps(data, indent=2))
        return
    for series in found:
        out.print("\n".join(_histogram(series)) + "\n")
        if series.reference is None:
            out.print(series.why_not)
        else:
            out.print(beside(series.tick, series.reference, series.period_s))
        counts = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in series.disturbances._asdict().items())
        out.print(f"in the loop: {counts}\n")
    for grant in found[0].grants:
        if grant.refused:
            out.print(f"not granted: {grant.setting} ({grant.refused}); see hil doctor")
    out.print(f"load: {processes} busy processes" if processes else "load: none added (--load adds it)")
    for judgement in judged:
        verdict = f"{judgement.rate_hz:5g} Hz  {judgement.suitability:12}"
        out.print(textwrap.fill(judgement.reason, 80, initial_indent=verdict, subsequent_indent=" " * len(verdict)))


def _columns(series: Series) -> dict[str, Latencies]:
    found = {"tick": series.tick, "wake_up": series.wake_up}
    return found if series.reference is None else found | {"cyclictest": series.reference}


def _histogram(series: Series) -> Iterator[str]:
    """Yield a table of counts with bars whose length grows with the logarithm: single stalls must be seen."""
    from hil.loop.latency import HALF_DECADES
    from hil.loop.suitability import us

    columns = _columns(series)
    most = max(latencies.total for latencies in columns.values())
    counts = {name: latencies.bins() for name, latencies in columns.items()}
    yield f"latency at {1.0 / series.period_s:g} Hz, {series.tick.total} ticks; length of a bar: logarithm of the count"
    yield "".join([f"{'':12}", *(f"{name.replace('_', '-'):<{_BAR + 10}}" for name in columns)]).rstrip()
    used = [index for index in range(len(HALF_DECADES) + 1) if any(counts[name][index] for name in columns)]
    for index in range(min(used), max(used) + 1):
        label = f"< {us(HALF_DECADES[index])}" if index < len(HALF_DECADES) else f">= {us(HALF_DECADES[-1])}"
        cells = (f"{counts[name][index]:8} {_bar(counts[name][index], most):<{_BAR}}" for name in columns)
        yield f"{label:>12}{' '.join(cells)}".rstrip()
    for label, part in (("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("largest", 1.0)):
        cells = (f"{us(one.quantile(part)):>11}{'':{_BAR - 2}}" for one in columns.values())
        yield f"{label:>12}{' '.join(cells)}".rstrip()


def _bar(count: int, most: int) -> str:
    return "#" * math.ceil(_BAR * math.log1p(count) / math.log1p(most)) if count else ""


def _as_data(found: list[Series], processes: int) -> dict[str, Any]:
    from hil.loop.latency import HALF_DECADES
    from hil.loop.realtime import machine_state, now_text

    grants = found[0].grants
    return {
        "schema_version": 1,
        "time": now_text(),
        "machine": machine_state(),
        "busy_processes": processes,
        "granted": [grant.setting for grant in grants if not grant.refused],
        "refused": {grant.setting: grant.refused for grant in grants if grant.refused},
        "bin_edges_s": HALF_DECADES,
        "series": [
            {"period_s": series.period_s, "cyclictest_missing": series.why_not}
            | {"disturbances": series.disturbances._asdict()}
            | {name: _series_data(one, series.period_s) for name, one in _columns(series).items()}
            for series in found
        ],
    }


def _series_data(one: Latencies, period_s: float) -> dict[str, Any]:
    quantiles = {"p50_s": 0.5, "p99_s": 0.99, "p999_s": 0.999}
    return {
        "ticks": one.total,
        "missed": one.missed(period_s),
        **{name: one.quantile(part) for name, part in quantiles.items()},
        "largest_s": one.largest_s,
        "counts": one.bins(),
    }
