"""What the scope says of a run in words and numbers: state, faults, progress, punctuality, bus load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from drivers.cia402 import DriveState
from drivers.emcy import error_text
from hil.motion.trajectory import SegmentRun
from hil.scope.rows import ScopeRows
from hil.scope.traces import BEFORE, Trace

PUNCTUALITY_S = 2.0  # rows of which lateness is told


def state_text(number: float) -> str:
    """CiA 402 state in words, as its number is recorded."""
    try:
        return DriveState(round(number)).name.lower().replace("_", " ")
    except ValueError:
        return f"undefined state {number:g}"


def duration_s(metadata: Mapping[str, Any]) -> float | None:
    """Length of the profile [s], as the run planned it; None if that is not recorded."""
    try:
        return float(SegmentRun(**metadata["segments"][-1]).end_s) or None
    except (KeyError, IndexError, TypeError, ValueError):
        return None


def status(rows: ScopeRows, traces: Mapping[str, Trace]) -> dict[str, Any]:
    """Return state, fault, progress (0 to 1), values of the newest row in SI units, lateness of the last seconds."""
    end = rows.end
    block = rows.read(end - max(BEFORE + 1, round(PUNCTUALITY_S / rows.period_s)), end)
    if not len(block):
        return {"state": "no row yet"}
    last = {name: float(values[-1]) for name, values in block.columns.items()}
    newest = {name: values[-2:] for name, values in block.columns.items()}
    code, length_s = round(last.get("drive_error_code", 0.0)), duration_s(rows.metadata)
    certificate = rows.metadata.get("real_time") or {}
    told: dict[str, Any] = {
        "time_s": last["time_s"],
        "rows": end,
        "state": state_text(last["drive_state"]) if "drive_state" in last else "not recorded",
        "powered": last.get("drive_state") == DriveState.OPERATION_ENABLED,
        "fault": error_text(code) if code else "",
        "stopping": last.get("segment", 0.0) < 0.0,
        "progress": min(1.0, last["time_s"] / length_s) if length_s else None,
        "bus_load": certificate.get("bus_load"),
        "jitter_budget_s": (certificate.get("budget") or {}).get("jitter_p99_s"),
        "newest": {name: float(trace.values(newest)[-1]) for name, trace in traces.items()},
    }
    if "lateness_s" in block.columns:
        late, time_s = block.columns["lateness_s"], block.columns["time_s"]
        p50, p99 = np.quantile(late, (0.5, 0.99))
        told["lateness_s"] = {"p50": float(p50), "p99": float(p99), "max": float(late.max())}
        told["skipped"] = round(float(time_s[-1] - time_s[0]) / rows.period_s) + 1 - len(late)
    return told
