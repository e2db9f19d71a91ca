"""A bench for runs by the wall clock on a machine that stands still at times: no stall of seconds ends them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from hil.bench.bench_file import Bench
from hil.loop.run import RunResult
from hil.loop.simulated_bench import load_simulated

_STALL_S = 5.0


def patient_bench(**drive: Any) -> Bench:
    """Return the reference bench with wide bounds on lateness, and on where its axis gets meanwhile."""
    data = load_simulated("reference").model_dump()
    data["drive"] |= {
        "command_deadline_s": _STALL_S,
        "overrun_s": _STALL_S,
        "heartbeat_s": _STALL_S,
        "missed_answers": 100,
        "following_error_m": 10.0,
        "travel_m": (-10.0, 10.0),
    } | drive
    data["drive"]["supervision"] |= {"velocity_m_s": 100.0, "torque": 100.0, "torque_difference": 100.0}
    return Bench.model_validate(data)


def needs_every_tick(ran: RunResult) -> None:
    """Skip the test if ticks were left out: the axis then moved without a command, and the path is not that planned."""
    if ran.outcome.skipped:
        pytest.skip(f"this machine stood still: {ran.outcome.skipped} ticks left out")


def patient_bench_file(folder: Path) -> Path:
    """Write it into a folder; returns its path."""
    path = folder / "patient.yaml"
    path.write_text(yaml.safe_dump(patient_bench().model_dump(mode="json", exclude_none=True)))
    return path
