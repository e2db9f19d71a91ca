"""A late stamp is told from a jump of the sensor; a quasi-static measurement with gaps stays in one part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from foreign_axis import axis, renamed, write

from hil.importing.by_map import import_recording
from hil.importing.damage import jump_notes
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text
from hil.importing.slow_gaps import late_stamps, moving_little

RANDOM = np.random.default_rng(6)


def with_late_rows(rows: list[int]) -> dict[str, np.ndarray]:
    """The logger waits 6 ms after it read row i: its stamp is late, and the next row is 7 ms away."""
    columns = axis()
    sampled = np.arange(columns["t"].size) * 1e-3
    for row in rows:
        sampled[row + 1 :] += 6e-3
    read = {name: np.interp(sampled, columns["t"], values) for name, values in columns.items()}
    stamps = sampled + RANDOM.uniform(0.0, 2e-5, sampled.size)
    stamps[rows] += 5.8e-3
    return {name: values[:-60] for name, values in (read | {"t": stamps}).items()}


def test_a_late_stamp_is_found_and_no_jump() -> None:
    columns = with_late_rows([700, 2050])
    found = late_stamps(columns["angle"], columns["t"])
    np.testing.assert_array_equal(found, [700, 2050])
    assert not jump_notes("angle", columns["angle"], columns["t"])


def test_a_jump_of_the_sensor_is_no_late_stamp() -> None:
    columns = axis()
    columns["angle"][2000:] += 2.0
    assert late_stamps(columns["angle"], columns["t"]).size == 0
    assert jump_notes("angle", columns["angle"], columns["t"])


def test_a_late_stamp_is_said_in_the_map(tmp_path: Path) -> None:
    columns = renamed(with_late_rows([700]), t="time_s", angle="motor_rad", torque="torque_Nm")
    notes = draft_map(write(tmp_path / "log.csv", columns)).unsure
    assert any(note.startswith("late stamps: 1 rows") and "first row 701" in note for note in notes)
    assert not any("its sensor" in note for note in notes)


def staircase() -> dict[str, np.ndarray]:
    """Steps of 2 mrad over a turn there and back, a few rows at each, a pause before the next."""
    steps = np.r_[np.arange(0, 1500), np.arange(1500, 0, -1)] * 4e-3
    time_s, angle = [], []
    now = 0.0
    for step in steps:
        for _ in range(int(RANDOM.integers(3, 9))):
            now += float(RANDOM.uniform(0.011, 0.015))
            time_s.append(now)
            angle.append(step)
        now += float(RANDOM.uniform(0.2, 0.6))
    q = np.array(angle)
    current = 0.1 * np.sin(12 * q) + 0.05 + RANDOM.normal(0.0, 0.01, q.size)
    return {"time_s": np.array(time_s), "set_rad": q, "motor_rad": q + 2e-3 * current, "torque_Nm": current}


def test_a_quasi_static_measurement_stays_in_one_part(tmp_path: Path) -> None:
    columns = staircase()
    path, map_path = write(tmp_path / "map.csv", columns), tmp_path / "map.yaml"
    draft = draft_map(path)
    assert any("the axis hardly moves" in note for note in draft.unsure)
    map_path.write_text(map_text(draft))
    recording = import_recording(path, map_path)
    assert len(recording.parts()) == 1
    assert np.ptp(recording["motor_position_rad"]) > 5.9
    inner = np.interp(recording["time_s"] + columns["time_s"][0], columns["time_s"], columns["motor_rad"])
    assert np.abs(recording["motor_position_rad"] - inner).max() < 0.01


def test_gaps_of_a_fast_motion_and_of_long_parts_are_cut() -> None:
    columns = {"time_s": staircase()["time_s"]}
    columns["q"] = np.sin(3.0 * columns["time_s"])
    assert not moving_little(columns, ["q"])
    time_s = np.r_[np.arange(1000), np.arange(3000, 4000)] * 1e-3
    assert not moving_little({"time_s": time_s, "q": np.sin(time_s)}, ["q"])
