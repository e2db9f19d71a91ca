"""The claims about a run in the virtual machine can fail: each made up fault of a run breaks the claim about it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hil.bench.bench_file import load_bench

sys.path.insert(0, str(Path(__file__).parent / "guest"))
from judge import Claims, Run, judge

BENCH = load_bench(Path(__file__).parent / "guest/axis.yaml")
FAULT_S = 1.0
SCENARIO = SimpleNamespace(name="loop killed", ends=("signal",), stops_itself=True, drive_lives=True)


def rows(*, left_s: float = 1.05, end_state: int = 7, again: bool = False, end_m_s: float = 0.0) -> np.ndarray:
    """An axis at 0.2 m/s from 0.1 s on, braked by the drive's ramp from left_s on."""
    time_s = np.arange(0.1, 3.0, 0.002)
    state = np.where(time_s < left_s, 4, end_state)
    state[(time_s > 2.0) & again] = 4
    velocity_m_s = np.clip(0.2 - 1.6 * np.clip(time_s - left_s, 0.0, None), end_m_s, None)
    return np.column_stack([time_s, state, velocity_m_s, np.cumsum(velocity_m_s) * 0.002])


RUN = Run(
    BENCH, rows(), FAULT_S, 0.5, 3.0, True, "", {"Result": "signal", "ExecMainStatus": "9", "ActiveState": "failed"},
    "", {"rows": 225, "duration_s": 0.896, "closed": False, "certificate": {}}, True, 1)  # fmt: skip


def broken(run: Run) -> list[str]:
    """Claims that do not hold."""
    judge(run, SCENARIO, claims := Claims())
    return [text for text, holds, _ in claims.found if not holds]


def test_a_run_as_it_should_be_breaks_no_claim() -> None:
    assert broken(RUN) == []


@pytest.mark.parametrize(
    ("change", "claim"),
    [
        ({"truth": rows(left_s=1.3)}, "the drive stops by itself within"),
        ({"truth": rows(left_s=9.0)}, "the drive leaves OPERATION ENABLED"),
        ({"truth": rows(again=True)}, "it is not enabled again"),
        ({"truth": rows(end_state=5)}, "its power is off at the end"),
        ({"truth": rows(end_m_s=0.05)}, "the axis rests"),
        ({"latched": False}, "a failure is latched"),
        ({"started_again": 0}, "the latch refuses a start"),
        ({"state": RUN.state | {"Result": "success"}}, "ends by signal"),
        ({"recording": RUN.recording | {"rows": 0}}, "the recording can be read"),
        ({"recording": RUN.recording | {"duration_s": 0.7}}, "at most 100 ms before the fault are lost"),
    ],
)
def test_each_fault_of_a_run_breaks_its_claim(change: dict[str, object], claim: str) -> None:
    assert any(text.startswith(claim) for text in broken(replace(RUN, **change)))  # type: ignore[arg-type]
