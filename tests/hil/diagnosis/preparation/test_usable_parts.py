"""Recordings with gaps in time: commands work on the parts, and say which they leave out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import recorded

import hil
from hil.bench.bench_file import load_bench
from hil.commands.compare import compare as compare_command
from hil.commands.identify import identify
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.preparation.usable_parts import usable_parts
from hil.errors import InputError
from hil.recording.recording import Recording, write_parquet
from hil.recording.stamps import regular_rows

BENCH = load_bench("reference")
WHOLE = recorded(BENCH, times=4)
ROWS = len(WHOLE)


def cut(*without: tuple[int, int]) -> Recording:
    """The recording without some rows, as if a logger had stopped."""
    kept = np.delete(np.arange(ROWS), np.concatenate([np.arange(*one) for one in without]))
    columns = {name: values[kept] for name, values in WHOLE.columns.items()}
    rows = regular_rows(columns, lambda row: f"row {row}")
    parts = [{"row": part.row, "time_s": part.time_s} for part in rows.parts]
    return replace(WHOLE, name="cut", columns=rows.columns, metadata=WHOLE.metadata | {"parts": parts})


def test_a_recording_without_gaps_is_taken_as_it_is() -> None:
    usable = usable_parts([WHOLE], BENCH, to_split=True)
    assert usable.recordings == (WHOLE,)
    assert usable.notes == ()


def test_the_usable_parts_are_taken_and_the_others_named() -> None:
    recording = cut((ROWS // 2, ROWS // 2 + 300), (ROWS - 700, ROWS - 500))
    usable = usable_parts([recording], BENCH, to_split=False)
    assert [run.name for run in usable.recordings] == ["cut (part 1)", "cut (part 2)"]
    assert usable.recordings[1].start_s == pytest.approx((ROWS // 2 + 300) * WHOLE.period_s)
    assert "gaps in time cut it into 3 parts" in usable.notes[0]
    assert "cut (part 3): too short" in usable.notes[1]


def test_the_parts_are_diagnosed_as_recordings_of_one_axis() -> None:
    prepared = prepare([cut((1800, 2100), (3900, ROWS))], [], BENCH)
    assert [run.name for run in prepared.train.runs] == ["cut (part 1)"]
    assert [run.name for run in prepared.held_out.runs] == ["cut (part 2)"]
    assert any("gaps in time" in note for note in prepared.notes)
    assert any("held out as a whole" in note for note in prepared.notes)


def test_of_a_long_part_a_third_is_held_out_and_a_short_one_is_trained_on() -> None:
    prepared = prepare([cut((1800, 2000))], [], BENCH)
    assert [run.name for run in prepared.train.runs] == ["cut (part 2) (first part)", "cut (part 1)"]
    assert [run.name for run in prepared.held_out.runs] == ["cut (part 2) (last part)"]


def test_a_recording_of_short_parts_is_refused_with_the_reason() -> None:
    starts = range(700, ROWS, 900)
    with pytest.raises(InputError, match=r"none usable: cut \(part \d+\): too short"):
        usable_parts([cut(*((start, start + 200) for start in starts))], BENCH, to_split=True)


def test_a_comparison_takes_one_part() -> None:
    recording = cut((ROWS // 2, ROWS // 2 + 300))
    with pytest.raises(InputError, match=r"given a recording with gaps in time.* recording\.parts\(\)"):
        hil.compare(recording, BENCH)
    assert hil.compare(recording.parts()[0], BENCH).explained


@pytest.mark.long
def test_compare_identify_and_friction_work_on_the_parts(tmp_path: Path) -> None:
    recording = cut((ROWS // 2, ROWS // 2 + 300))
    write_parquet(recording, tmp_path / "cut.parquet")
    compare_command(tmp_path / "cut.parquet", "reference", False, tmp_path / "compared")
    assert sorted(path.name for path in (tmp_path / "compared").iterdir()) == ["part-1", "part-2"]
    identify([tmp_path / "cut.parquet"], tmp_path / "axis.yaml")
    text = (tmp_path / "axis.yaml").read_text()
    assert "friction of 2 parts together" in text
    assert load_bench(tmp_path / "axis.yaml").axis.lead_m == pytest.approx(0.010, rel=1e-3)
    found, whole = (hil.identify_friction(run, settling_s=0.02) for run in (recording, WHOLE))
    assert 4 <= len(found.points) <= len(whole.points) + 1
    assert found.coulomb == pytest.approx(whole.coulomb, rel=0.05)
