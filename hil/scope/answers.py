"""What a page is told: of the rows it sees, and what it asked about a stretch of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.quantities import reading_units
from hil.scope.analysis import amplitude_spectrum, statistics
from hil.scope.messages import frame, note
from hil.scope.rows import FixedRows, ScopeRows
from hil.scope.traces import Trace

SPECTRUM_POINTS = 2000
XY_POINTS = 4000


def of_rows(
    rows: ScopeRows, traces: Mapping[str, Trace], recordings: Sequence[FixedRows], about: Mapping[str, Any]
) -> str:
    """Describe rows: name, bench, period [s], traces, and the units in which each SI unit of them is read."""
    return note(
        "rows",
        name=rows.name,
        bench=str((rows.metadata.get("bench") or {}).get("name", "")),
        period_s=rows.period_s,
        live=not recordings,
        recordings=[one.name for one in recordings],
        traces=[trace.described for trace in traces.values()],
        units={trace.unit: reading_units(trace.unit) for trace in traces.values()},
        **about,
    )


def measured(names: Sequence[str], values: FloatArray) -> str:
    """Statistics of time and traces (1 + traces, n)."""
    found = {name: statistics(line) for name, line in zip(names, values[1:], strict=True)}
    return note("measured", from_s=float(values[0, 0]), to_s=float(values[0, -1]), rows=values.shape[1], traces=found)


def spectrum(name: str, values: FloatArray, period_s: float) -> bytes:
    """Amplitude spectrum of time and one trace (2, n)."""
    return frame("spectrum", np.stack(amplitude_spectrum(values[1], period_s, SPECTRUM_POINTS)), traces=[name])


def against(names: Sequence[str], values: FloatArray) -> bytes:
    """Pairs of time and two traces (3, n), thinned to rows at equal distances so that they stay pairs."""
    return frame("xy", values[1:, :: -(-values.shape[1] // XY_POINTS)], traces=list(names))
