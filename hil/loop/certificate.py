"""The certificate of a recording, `real_time` of its metadata: how punctual its loop was, on what machine and bus.

Written before arming: clock, period, share of the bus's time, budget of the bench, settings that the machine granted or
refused, jitter before arming. Added at the end: `run`, the lateness of its ticks, those missed and left out, and what
disturbed the loop. A run that was not closed gets the latter from its rows (`hil recover`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hil.bench.hardware import DriveSection
from hil.loop.disturbances import Disturbances
from hil.loop.realtime import Jitter

KEY = "real_time"


def before_run(
    period_s: float, bus_load: float, section: DriveSection, conditions: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Certificate as known before arming. conditions: `hil.loop.realtime.report`, None in virtual time."""
    return {
        "clock": "virtual" if conditions is None else "wall",
        "period_s": period_s,
        "bus_load": bus_load,
        "budget": {"jitter_p99_s": section.jitter_p99 * period_s, "bus_load": section.bus_load},
        **(conditions or {}),
    }


def of_run(
    lateness_s: Sequence[float], skipped: int, period_s: float, disturbances: Disturbances | None = None
) -> dict[str, Any]:
    """Part `run` of a certificate. lateness_s: of each tick; skipped: ticks left out; disturbances: None if unknown."""
    counted = disturbances._asdict() if disturbances is not None else {}
    return {"run": asdict(Jitter.of(lateness_s, period_s)) | {"skipped": skipped} | counted}


def of_rows(columns: Mapping[str, Any], metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Metadata of a run that was not closed: its certificate from the rows that are left, as columns by channel."""
    if "lateness_s" not in columns or KEY not in metadata:
        return {}
    period_s = float(metadata["period_s"])
    missing = np.rint(np.diff(columns["time_s"]) / period_s).astype(int) - 1
    run = of_run(columns["lateness_s"].tolist(), int(missing[missing > 0].sum()), period_s)
    return {KEY: dict(metadata[KEY]) | run}
