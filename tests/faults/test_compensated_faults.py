"""Faults of a run whose controller compensates: the axis stops as without it."""

from __future__ import annotations

from typing import Any

import matrix
import pytest
from matrix import one_run
from observed_run import bench_with

from hil.bench.bench_file import Bench, load_bench
from hil.bench.hardware import DriveMode
from hil.control.compensation_tables import Adds
from hil.manual.keys import EXAMPLES

FADE_IN_S = 0.02  # as short as the rest before the move


def _compensated(**changes: dict[str, Any]) -> Bench:
    """The bench of the matrix with tables; a drive that makes its torque gets those of the position only."""
    bench, section = bench_with(**changes), load_bench(EXAMPLES / "bench-compensated.yaml").compensation
    assert section is not None
    assert bench.drive is not None
    torque = bench.drive.mode is DriveMode.CST
    entries = tuple(entry for entry in section.entries if torque or entry.adds is Adds.POSITION)
    section = section.model_copy(update={"fade_in_s": FADE_IN_S, "entries": entries})
    return Bench.model_validate(bench.model_dump() | {"compensation": section.model_dump()})


@pytest.mark.parametrize("seed", range(1, 25))
def test_a_fault_stops_a_compensated_axis(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matrix, "bench_with", _compensated)
    run = one_run(seed)
    assert not run.wrong, f"{run.fault} in {run.state} ({run.about})"
