"""A term that goes on with time is tested within the time of training: the middle of a recording is held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import write
from scipy.signal import lfilter

from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.verdict.middle_held_out import with_middle_held_out
from hil.drafting.drafted_bench import drafted
from hil.explanation import explain
from hil.identification.measured import Measured
from hil.recording.recording import read_recording


def warming(folder: Path, seed: int) -> Path:
    """A minute of an axis whose friction falls by a quarter with 25 s, and wanders, in rows of 20 ms."""
    random, t = np.random.default_rng(seed), 0.02 * np.arange(3000)
    angle, speed, acceleration = (np.zeros(t.size) for _ in range(3))
    for size, frequency_hz, phase in ((30.0, 0.11, 0.0), (12.0, 0.27, 1.0)):
        w = 2.0 * np.pi * frequency_hz
        angle += size * (np.sin(w * t + phase) - np.sin(phase))
        speed += size * w * np.cos(w * t + phase)
        acceleration -= size * w**2 * np.sin(w * t + phase)
    wander = lfilter([1.0], [1.0, -0.98], random.normal(0.0, 0.006, t.size))
    friction = (0.4 + 0.14 * np.exp(-t / 25.0) + wander) * np.sign(speed)
    torque = 2e-3 * acceleration + 0.01 * speed + friction + random.normal(0.0, 0.04, t.size)
    count = 2.0 * np.pi / 2**17
    columns = {"time_s": t, "motor_angle_rad": np.round(angle / count) * count, "torque_Nm": torque}
    return write(folder / "log.csv", columns)


@pytest.mark.long
def test_a_drift_that_the_end_refutes_is_named_by_the_middle(tmp_path: Path) -> None:
    """Two thirds tell the time constant so badly that the last third is predicted worse with the drift than without."""
    found = explain([warming(tmp_path, 2)], tmp_path / "out")
    result = found.diagnosis.result
    assert [one.effect for one in result.missing] == ["friction_drift"]
    assert result.missing[0].parameters["fraction"].value == pytest.approx(-0.26, abs=0.06)
    assert any("the middle of each recording is used for validation" in one for one in result.notes)
    assert not any("the last part" in one for one in result.notes)
    assert "held out: its middle part" in found.report.read_text(encoding="utf-8")
    (held,) = found.diagnosis.held_out.runs
    assert min(run.time_s[0] for run in found.diagnosis.train.runs) < held.time_s[held.evaluated][0]
    assert held.time_s[-1] < max(run.time_s[-1] for run in found.diagnosis.train.runs)


def test_the_parts_cover_what_they_did(tmp_path: Path) -> None:
    """Each row that was judged is judged once, in training or held out; recordings that were given stay held out."""
    import_(warming(tmp_path, 2), None, tmp_path / "log.parquet")
    recording = read_recording(tmp_path / "log.parquet")
    bench = drafted([recording]).bench
    prepared = prepare([recording], [], bench)
    inside = with_middle_held_out(prepared)
    assert inside is not None
    before = _times((*prepared.train.runs, *prepared.held_out.runs))
    after = _times((*inside.train.runs, *inside.held_out.runs))
    np.testing.assert_allclose(np.sort(after), np.sort(before))
    assert [run.name for run in inside.train.runs] == ["log (first part)", "log (last part)"]
    assert with_middle_held_out(inside) is None

    backwards = {name: values[::-1].copy() for name, values in recording.columns.items()}
    for name in ("another", recording.name):
        given = prepare([recording], [replace(recording, name=name, columns=backwards, start_s=70.0)], bench)
        assert with_middle_held_out(given) is None


def _times(runs: Sequence[Measured]) -> np.ndarray:
    return np.concatenate([run.time_s[run.evaluated] for run in runs])
