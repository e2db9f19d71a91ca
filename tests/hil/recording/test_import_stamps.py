"""A file of a PC logger, with stamps that jitter and rows without a value, is imported as the axis moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil.importing.by_map import import_recording
from hil.recording.recording import read_recording, write_parquet


def test_a_belt_whose_stamps_jitter_is_imported_by_its_row_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    ticks_s = np.arange(5000) * 4e-3
    position_mm = np.round(300.0 * np.sin(2 * np.pi * 0.4 * ticks_s) + 60.0 * np.sin(2 * np.pi * 1.7 * ticks_s), 3)
    stamps_s = ticks_s + rng.normal(0.0, 5e-5, ticks_s.size)
    lost = rng.integers(100, 4900, 15)
    rows = [f"{t:.5f};{x:.3f};{np.cos(t):.2f}" for t, x in zip(stamps_s, position_mm, strict=True)]
    for row in lost:
        rows[row] = f"{stamps_s[row]:.5f};;0.00"
    (tmp_path / "run.csv").write_text("t;x;f\n" + "\n".join(rows) + "\n")
    (tmp_path / "map.yaml").write_text(
        "about: belt\ntime: {column: t, unit: s}\nresample_hz: 249.688\nmissing: leave_out\ncsv: {delimiter: ';'}\n"
        "channels:\n  motor_position_m: {column: x, unit: mm}\n  force_n: {column: f, unit: N}\n"
    )
    recording = import_recording(tmp_path / "run.csv", tmp_path / "map.yaml")
    assert len(recording) == ticks_s.size
    assert recording.period_s == pytest.approx(4e-3, rel=1e-6)
    there = np.setdiff1d(np.arange(ticks_s.size), lost)
    np.testing.assert_allclose(recording["motor_position_m"][there], 1e-3 * position_mm[there], atol=1e-12)
    notes = recording.metadata["clock_notes"]
    assert any(
        "the stamps jitter by 5" in note and "equal ticks of 4 ms: the row number is the clock" in note
        for note in notes
    )
    write_parquet(recording, tmp_path / "run.parquet")
    np.testing.assert_array_equal(read_recording(tmp_path / "run.parquet")["time_s"], recording["time_s"])
