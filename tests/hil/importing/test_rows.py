"""Repeated samples are kept once, lost ones found; counters that start again are unwrapped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil.importing.by_map import import_recording
from hil.importing.held_samples import kept_rows, lost_samples, rows_per_sample, rows_per_slowest_sample, slower
from hil.importing.rows import complete_rows
from hil.importing.spikes import lone_values
from hil.importing.wraps import unwrapped, wrap_range
from hil.recording.recording import read_recording, write_parquet

RANDOM = np.random.default_rng(12)
T = np.arange(4000) * 1e-3
ANGLE = 40.0 * np.sin(2 * np.pi * 0.5 * T) + 6.0 * np.sin(2 * np.pi * 2.3 * T)
COUNTS = np.round(ANGLE * 4096 / (2 * np.pi))
COLUMNS = {"angle": COUNTS, "torque": np.round(np.gradient(ANGLE) * 50 + RANDOM.normal(0.0, 0.3, T.size), 1)}
FINE = COLUMNS | {"torque": COLUMNS["torque"] + RANDOM.normal(0.0, 0.3, T.size)}  # repeats only if a sample is lost


@pytest.mark.parametrize("ratio", [1, 2, 5])
def test_repeated_samples_are_counted_and_kept_once(ratio: int) -> None:
    logged = {name: np.repeat(values, ratio) for name, values in COLUMNS.items()}
    assert rows_per_sample(logged) == ratio
    if ratio > 1:
        kept = kept_rows(logged, float(ratio))
        np.testing.assert_array_equal(logged["angle"][kept], COUNTS)


def test_a_logger_at_another_rate_keeps_each_sample() -> None:
    index = np.floor(np.arange(int(1.6 * T.size)) / 1.6).astype(int)
    logged = {name: values[index] for name, values in COLUMNS.items()}
    ratio = rows_per_sample(logged)
    assert ratio == pytest.approx(1.6, rel=0.01)
    assert kept_rows(logged, ratio).size == pytest.approx(T.size, rel=0.01)


def test_a_few_lost_samples_in_motion_are_found() -> None:
    rows = np.array([200, 900, 1250, 2075, 3100])
    logged = {name: values.copy() for name, values in COLUMNS.items()}
    for values in logged.values():
        values[rows] = values[rows - 1]
    found = np.flatnonzero(lost_samples(logged))
    assert set(found) <= set(rows)
    assert found.size >= 4  # not where the axis turns


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2])
def test_lost_samples_are_left_out_and_said(share: float) -> None:
    rows = np.sort(np.random.default_rng(8).choice(np.arange(20, T.size - 20), int(share * T.size), replace=False))
    for columns, least in ((COLUMNS, 0.2), (FINE, 0.9)):
        logged = {name: values.copy() for name, values in columns.items()}
        for values in logged.values():
            for row in rows:
                values[row] = values[row - 1]
        complete = complete_rows(logged | {"time_s": T})
        left_out = np.setdiff1d(np.arange(T.size), complete.rows)
        assert set(left_out) <= set(rows)
        assert left_out.size > least * rows.size  # not where the axis turns
        assert [note for note in complete.notes if note.startswith(f"lost samples: {left_out.size} rows")]


def test_lost_samples_are_no_faster_logger() -> None:
    rows = np.sort(np.random.default_rng(9).choice(np.arange(1, T.size), T.size // 5, replace=False))
    index = np.arange(T.size)
    for row in rows:
        index[row] = index[row - 1]
    assert rows_per_sample({name: values[index] for name, values in FINE.items()}) == 1.0


def test_samples_of_a_logger_five_percent_faster_are_not_lost() -> None:
    index = np.floor(np.arange(int(1.05 * T.size)) / 1.05).astype(int)
    assert not lost_samples({name: values[index] for name, values in FINE.items()}).any()


def test_single_values_off_the_motion_are_left_out_and_said() -> None:
    rows = np.array([300, 1020, 1025, 2500, 3300])
    angle = ANGLE.copy()
    angle[rows] += np.array([1.0, -1.0, 2.0, 1.0, -3.0])
    complete = complete_rows({"angle": angle, "time_s": T}, positions=["angle"])
    assert set(np.setdiff1d(np.arange(T.size), complete.rows)) == set(rows[[0, 3, 4]])  # two close ones hide each other
    assert [note for note in complete.notes if note.startswith("spikes: angle is off the motion for one row in 3")]


@pytest.mark.parametrize("noise", [0.0, 0.01, 1.0])
def test_noise_flickering_counts_steps_and_vibration_are_no_spikes(noise: float) -> None:
    white = np.random.default_rng(6).normal(0.0, 1.0, (20, T.size))
    step = np.where(T > 2.0, 5.0, 0.0)
    vibration = np.where(T > 2.0, np.exp(-200.0 * (T - 2.0)) * np.sin(2 * np.pi * 200.0 * T), 0.0)
    for one in white:
        for position in (COUNTS, ANGLE, step, np.round(3.0 * vibration, 2)):
            assert not lone_values(np.round(position + noise * one, 3)).any()


@pytest.mark.parametrize("rows", [50, 250])
def test_turning_within_one_row_is_no_spike(rows: int) -> None:
    there_and_back = np.abs(np.arange(4000) % (2 * rows) - rows + 0.3)
    assert not lone_values(there_and_back).any()


def test_a_stepper_and_digits_that_grow_are_not_sampled_more_slowly() -> None:
    rng = np.random.default_rng(7)
    torque = rng.normal(0.0, 1.0, 12000)
    index = np.arange(12000)
    stepper = np.round(0.05 * (index // 50 + 1 - np.exp(-(index % 50) / 2.0)), 3)
    feed = np.where(index < 1500, 0.12 * index, 180.0 + 5e-4 * (index - 1500))
    printed = np.array([float(f"{value:.6g}") for value in feed])
    for position in (stepper, printed):
        assert rows_per_slowest_sample({"x": position, "torque": torque}, ["x"]) == 1.0
    held = feed[index // 3 * 3]
    assert rows_per_slowest_sample({"x": held, "torque": torque}, ["x"]) == 3.0
    assert slower({"x": held, "torque": torque}, 3.0) == ["x"]
    short = {"x": held[1400:1600], "torque": torque[1400:1600]}  # another file by the map of the first
    np.testing.assert_array_equal(kept_rows(short, 3.0), np.arange(1, 200, 3))


def test_rest_slow_counts_and_a_jump_from_rest_are_no_lost_samples() -> None:
    jump = {"angle": np.where(T > 2.0, 500.0, 0.0), "torque": np.zeros(T.size)}
    slow = {"angle": np.round(COUNTS / 400.0), "torque": np.zeros(T.size)}
    for columns in (COLUMNS, jump, slow):
        assert not lost_samples(columns).any()


@pytest.mark.parametrize("counts_per_row", [2.0, 4.0])
def test_noise_of_half_a_count_is_no_lost_sample(counts_per_row: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        counts = np.round(counts_per_row * np.arange(4000) + rng.normal(0.0, 0.5, 4000))
        assert not lost_samples({"angle": counts, "torque": np.repeat(rng.normal(0.0, 1.0, 100), 40)}).any()


def test_rest_and_coarse_counts_are_no_repetitions() -> None:
    slow = {"angle": np.round(COUNTS / 400.0), "torque": np.round(COLUMNS["torque"])}
    assert rows_per_sample(slow) == 1.0
    still = {name: np.r_[np.full(3000, values[0]), values] for name, values in COLUMNS.items()}
    assert rows_per_sample(still) == 1.0


@pytest.mark.parametrize(
    ("values", "size"),
    [
        (np.mod(COUNTS, 4096), 4096.0),
        (np.mod(COUNTS + 32768, 65536) - 32768, None),  # does not reach the end of its range
        (np.mod(8 * COUNTS + 32768, 65536) - 32768, 65536.0),
        (np.mod(np.rad2deg(ANGLE), 360.0), 360.0),
        (np.mod(ANGLE + np.pi, 2 * np.pi) - np.pi, 2 * np.pi),
        (np.mod(np.cumsum(66.0 + RANDOM.normal(0.0, 0.3, 600)), 360.0), 360.0),  # 2200 rpm in rows of 5 ms
    ],
)
def test_a_wrap_is_found_with_its_range(values: np.ndarray, size: float | None) -> None:
    found = wrap_range(values)
    assert found == (pytest.approx(size) if size else None)
    if size:
        assert np.abs(np.diff(unwrapped(values, size))).max() < 0.2 * size


@pytest.mark.parametrize(
    "values",
    [
        np.sign(np.sin(7.0 * T)) + 1e-3 * RANDOM.normal(size=T.size),  # a switched voltage
        np.where(np.arange(T.size) == 800, -9999.0, ANGLE),  # a placeholder
        np.where(T > 2.0, ANGLE + 500.0, ANGLE),  # a jump
        RANDOM.normal(size=T.size),
        RANDOM.uniform(0.0, 360.0, T.size),
        np.mod(np.cumsum(np.full(600, 0.2 * 32768.0)), 32768.0) * 1.02,  # fast, by no usual range
        460.0 * np.sign(np.sin(7.0 * T)) + RANDOM.normal(size=T.size),
        ANGLE,
    ],
)
def test_other_jumps_are_no_wraps(values: np.ndarray) -> None:
    assert wrap_range(values) is None


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
