"""A mismatch of which a part has a name: the part is told, and what is left is not given a name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.bench.bench_file import load_bench
from hil.diagnosis.diagnose import diagnose
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.report.diagnosis_report import write_diagnosis

AMPLITUDE_N_M = 0.3


def with_bursts(run: Recording) -> Recording:
    """The recording with bursts of noise on its linear encoder, which no mechanism of the library describes."""
    rng = np.random.default_rng(3)
    table_m = run["table_position_m"].copy()
    for start in range(400, table_m.size - 100, 700):
        table_m[start : start + 60] += 3e-6 * rng.standard_normal(60)
    return changed(run, table_position_m=table_m)


def test_the_part_that_is_explained_is_told(tmp_path: Path) -> None:
    owner = bench()
    cogging = Term("cogging_torque", 0, (AMPLITUDE_N_M, 6.0, 0.4))
    train, held_out = (with_bursts(recorded(owner, cogging, seed=seed, name=f"run_{seed}")) for seed in (1, 2))
    found = diagnose([train], [held_out], owner)
    result = found.result
    assert result.verdict == "unexplained"
    assert not result.missing
    (part,) = result.partial
    assert part.effect == "cogging_torque"
    assert part.parameters["amplitude_n_m"].value == pytest.approx(AMPLITUDE_N_M, rel=0.02)
    assert 0.02 < result.unexplained.share < 0.5
    assert "table_position_m" in result.unexplained.description
    write_diagnosis(found, tmp_path)
    assert "Explains a part: cogging torque" in (tmp_path / "report.html").read_text()
    assert [entry.effect for entry in load_bench(tmp_path / "bench.diagnosed.yaml").mechanisms] == ["cogging_torque"]
