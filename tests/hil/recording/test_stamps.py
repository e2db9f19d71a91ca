"""Stamps of any logger become a regular clock: gaps cut, jitter evened out, single missing rows interpolated."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from hil.errors import InputError
from hil.recording.clock_notes import LEAST_ROWS
from hil.recording.recording import Recording, arrow_schema, read_recording, write_parquet, write_table
from hil.recording.stamps import RegularRows, regular_rows

RANDOM = np.random.default_rng(11)
ROWS, PERIOD_S = 3000, 1e-3
TICKS_S = np.arange(ROWS) * PERIOD_S


def position(time_s: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * time_s) + 0.3 * np.sin(2 * np.pi * 3.1 * time_s)


def made(time_s: np.ndarray, values: np.ndarray, rate_hz: float | None = None) -> RegularRows:
    return regular_rows({"time_s": time_s, "x": values}, lambda row: f"row {row}", rate_hz)


@pytest.mark.parametrize("start_s", [0.0, 12345.6, 1.7e9])
def test_a_gap_cuts_and_each_part_keeps_its_time(start_s: float) -> None:
    kept = np.r_[0:1000, 1500:ROWS]
    rows = made(start_s + TICKS_S[kept], position(TICKS_S)[kept])
    assert [(part.row, round(part.time_s, 6)) for part in rows.parts] == [(0, 0.0), (1000, 1.5)]
    assert rows.period_s == pytest.approx(PERIOD_S, rel=1e-6)
    np.testing.assert_array_equal(rows.columns["x"], position(TICKS_S)[kept])
    assert "a gap of 0.501 s" in rows.notes[0]


def test_a_part_of_few_rows_is_left_out_and_said() -> None:
    kept = np.r_[0:1000, 1500:1520, 2000:ROWS]
    rows = made(TICKS_S[kept], position(TICKS_S)[kept])
    assert [part.row for part in rows.parts] == [0, 1000]
    assert f"20 rows in parts of less than {LEAST_ROWS} are left out" in rows.notes[0]


def test_single_missing_rows_are_interpolated_and_the_others_stay() -> None:
    kept = np.delete(np.arange(ROWS), [700, 1200, 1201])
    rows = made(TICKS_S[kept], position(TICKS_S)[kept])
    assert len(rows.parts) == 1
    np.testing.assert_allclose(rows.columns["time_s"], TICKS_S, atol=1e-12)
    np.testing.assert_allclose(rows.columns["x"][kept], position(TICKS_S)[kept], atol=1e-12)
    assert "3 rows are missing in 2 places" in rows.notes[0]


def test_jitter_of_the_stamps_is_told_from_jitter_of_the_rows() -> None:
    uneven_s = TICKS_S + RANDOM.uniform(-2e-4, 2e-4, ROWS)
    of_stamps = made(uneven_s, position(TICKS_S))
    assert of_stamps.rate_hz is None
    assert "but the rows are equal ticks of 1 ms: the row number is the clock" in of_stamps.notes[0]
    np.testing.assert_array_equal(of_stamps.columns["x"], position(TICKS_S))
    of_rows = made(uneven_s, position(uneven_s))
    assert of_rows.rate_hz == pytest.approx(1000.0, rel=1e-3)
    np.testing.assert_allclose(of_rows.columns["x"], position(of_rows.columns["time_s"]), atol=1e-4)


def test_missing_rows_are_filled_at_their_ticks_and_the_last_row_stays() -> None:
    kept = np.delete(np.arange(ROWS), [700, 1200, 1201])
    rows = made((TICKS_S + RANDOM.normal(0.0, 5e-5, ROWS))[kept], position(TICKS_S)[kept])
    np.testing.assert_array_equal(rows.columns["x"][kept], position(TICKS_S)[kept])
    assert rows.columns["x"].size == ROWS
    np.testing.assert_allclose(np.diff(rows.columns["time_s"]), rows.period_s, rtol=1e-9)
    assert "the stamps jitter by" in rows.notes[0]
    assert "3 rows are missing in 2 places" in rows.notes[1]


@pytest.mark.parametrize("wanted_hz", [998.7, 1001.0])
def test_a_rate_near_that_of_equal_ticks_asks_for_nothing(wanted_hz: float) -> None:
    for time_s in (TICKS_S, TICKS_S + RANDOM.normal(0.0, 5e-5, ROWS)):
        rows = made(time_s, position(TICKS_S), wanted_hz)
        assert rows.rate_hz is None
        np.testing.assert_array_equal(rows.columns["x"], position(TICKS_S))


def test_equal_ticks_are_interpolated_to_another_rate_that_is_wanted() -> None:
    rows = made(TICKS_S + RANDOM.normal(0.0, 5e-5, ROWS), position(TICKS_S), 400.0)
    assert rows.rate_hz == 400.0
    # the first stamp is that of the first tick: a shift of the whole, no jitter
    shift_s = rows.columns["time_s"][0]
    np.testing.assert_allclose(rows.columns["x"], position(rows.columns["time_s"] - shift_s), atol=5e-5)
    assert "interpolated from ticks of 1 ms to 400 Hz" in rows.notes[-1]


def test_the_note_on_uneven_rows_tells_the_steps_apart() -> None:
    uneven_s = TICKS_S + RANDOM.uniform(-2e-4, 2e-4, ROWS)
    note = made(uneven_s, position(uneven_s)).notes[0]
    assert re.search(r"typically (99\d\.?\d*|1\.?\d*) (us|ms), from 6\d\d\.?\d* us to 1\.3\d* ms; .* to \d+ Hz", note)
    assert "to 1000 Hz" in note
    assert "does not tell" not in note
    assert "the motion does not tell" in made(uneven_s, RANDOM.normal(size=ROWS)).notes[0]


def test_a_csv_recording_with_uneven_stamps_is_read_by_its_rows(tmp_path: Path) -> None:
    stamps_s = 20.0 + TICKS_S + RANDOM.normal(0.0, 5e-5, ROWS)
    lines = [f"{t:.6f},{x:.9f},{np.cos(x):.6f}" for t, x in zip(stamps_s, position(TICKS_S), strict=True)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["time_s,motor_position_rad,torque_n_m", *lines]) + "\n")
    recording = read_recording(path)
    np.testing.assert_allclose(recording["motor_position_rad"], position(TICKS_S), atol=1e-9)
    assert "the row number is the clock" in recording.metadata["clock_notes"][0]
    assert "resampled" not in recording.metadata


def test_noise_alone_leaves_the_stamps_right() -> None:
    assert made(TICKS_S + RANDOM.uniform(-2e-4, 2e-4, ROWS), RANDOM.normal(size=ROWS)).rate_hz is not None


def test_stamps_with_few_digits_get_equal_steps_in_each_part() -> None:
    quick_s = np.arange(ROWS) * 2.5e-4
    kept = np.r_[0:1000, 2000:ROWS]
    rows = made(np.floor(quick_s[kept] * 1e3) / 1e3, position(quick_s)[kept])
    assert rows.period_s == pytest.approx(2.5e-4, rel=2e-3)
    assert [part.row for part in rows.parts] == [0, 1000]


def test_a_rate_that_changes_for_good_is_refused() -> None:
    time_s = np.r_[TICKS_S[:1500], TICKS_S[1500::4]]
    with pytest.raises(InputError, match="two sampling rates"):
        made(time_s, position(time_s))


@pytest.mark.parametrize("late", [slice(0, 800, 2), slice(0, 2400, 2)])
def test_a_loop_that_was_late_for_long_has_one_rate(late: slice, tmp_path: Path) -> None:
    kept = np.r_[np.arange(ROWS)[late], late.stop : ROWS]
    columns = {"time_s": TICKS_S[kept], "motor_position_rad": position(TICKS_S[kept]), "torque_n_m": np.ones(kept.size)}
    write_parquet(Recording("run", columns, PERIOD_S, {}), tmp_path / "run.parquet")
    recording = read_recording(tmp_path / "run.parquet")
    assert recording.period_s == PERIOD_S
    np.testing.assert_allclose(recording["time_s"], TICKS_S, atol=1e-12)
    missing = ROWS - kept.size
    note = f"{missing} rows are missing in {missing} places at a period of 0.001 s"
    assert note in recording.metadata["clock_notes"][0]


def test_a_short_recording_of_a_late_loop_is_read_by_its_known_period(tmp_path: Path) -> None:
    kept = np.r_[0:5, 7, 10:14, 20:40]
    assert kept.size < LEAST_ROWS
    columns = {"time_s": TICKS_S[kept], "motor_position_rad": position(TICKS_S[kept]), "torque_n_m": np.ones(kept.size)}
    write_parquet(Recording("run", columns, PERIOD_S, {}), tmp_path / "run.parquet")
    np.testing.assert_allclose(read_recording(tmp_path / "run.parquet")["time_s"], TICKS_S[:40], atol=1e-12)
    with pytest.raises(InputError, match="rows are missing"):  # without the period the clock cannot be told
        made(TICKS_S[kept], position(TICKS_S[kept]))


@pytest.mark.parametrize("period_s", [0.0005, 0.0, -0.001, float("nan")])
def test_a_stored_period_that_is_none_of_the_rows_is_damaged(period_s: float, tmp_path: Path) -> None:
    columns = {"time_s": TICKS_S, "motor_position_rad": position(TICKS_S), "torque_n_m": np.ones(ROWS)}
    schema = arrow_schema(columns, {"period_s": period_s})
    write_table(pa.Table.from_arrays(list(columns.values()), schema=schema), tmp_path / "run.parquet")
    with pytest.raises(InputError, match=r"damaged|period_s"):
        read_recording(tmp_path / "run.parquet")


def _csv(path: Path, kept: np.ndarray) -> Path:
    lines = [f"{t:.4f},{position(t):.9f},{np.cos(t):.6f}" for t in 20.0 + TICKS_S[kept]]
    path.write_text("\n".join(["time_s,motor_position_rad,torque_n_m", *lines]) + "\n")
    return path


def test_a_file_with_gaps_is_one_recording_with_parts(tmp_path: Path) -> None:
    recording = read_recording(_csv(tmp_path / "run.csv", np.r_[0:1000, 1500:ROWS]))
    first, second = recording.parts()
    assert (first.name, second.name) == ("run (part 1)", "run (part 2)")
    assert (len(first), len(second)) == (1000, 1500)
    assert second.start_s == pytest.approx(1.5)
    assert second["time_s"][0] == pytest.approx(21.5)
    assert second.parts() == (second,)
    write_parquet(recording, tmp_path / "run.parquet")
    assert [len(part) for part in read_recording(tmp_path / "run.parquet").parts()] == [1000, 1500]


def test_a_recording_without_gaps_is_its_only_part(tmp_path: Path) -> None:
    recording = read_recording(_csv(tmp_path / "run.csv", np.arange(ROWS)))
    assert isinstance(recording, Recording)
    assert recording.parts() == (recording,)


def test_steps_without_digits_are_refused() -> None:
    with pytest.raises(InputError, match="given steps of 1e-303 s, allowed 1e-09 s or more"):
        made(TICKS_S * 1e-300, position(TICKS_S))


@pytest.mark.long
def test_rows_that_would_fill_the_memory_are_refused() -> None:
    uneven_s = TICKS_S + RANDOM.uniform(-2e-4, 2e-4, ROWS)
    with pytest.raises(InputError, match=r"rows of 2 channels at 1e\+09 Hz, allowed 50000000 values together"):
        made(uneven_s, position(TICKS_S), 1e9)
    columns = {"time_s": np.r_[0.0, 1e-9, 8e-9 * np.arange(1, 7_000_000)], "x": np.zeros(7_000_001)}
    with pytest.raises(InputError, match=r"rows of 2 channels at 1e\+09 Hz, allowed 50000000 values together"):
        regular_rows(columns, lambda row: f"row {row}", period_s=1e-9)
