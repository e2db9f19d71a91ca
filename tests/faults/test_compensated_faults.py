"""Faults of a run whose controller compensates: the axis stops as without it."""

from __future__ import annotations

import observed_run
import pytest
from matrix import one_run

from hil.bench.bench_file import Bench, load_bench
from hil.loop.simulated_bench import load_simulated
from hil.manual.keys import EXAMPLES


def _compensated(name: str) -> Bench:
    section = load_bench(EXAMPLES / "bench-compensated.yaml").compensation
    assert section is not None
    section = section.model_copy(update={"fade_in_s": 0.02})  # as short as the rest before the move
    return load_simulated(name).model_copy(update={"compensation": section})


@pytest.mark.parametrize("seed", range(1, 25))
def test_a_fault_stops_a_compensated_axis(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(observed_run, "load_simulated", _compensated)
    run = one_run(seed)
    assert not run.wrong, f"{run.fault} in {run.state} ({run.about})"
