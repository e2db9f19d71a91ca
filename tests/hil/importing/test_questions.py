"""What a drafted map asks for says the lines to write, and with them the import succeeds."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from command_line import hil
from foreign_axis import axis, write

from hil.recording.recording import read_recording

AXIS = axis()
SPIKES = np.where(np.arange(AXIS["t"].size) % 700 < 3, AXIS["torque"], 0.0)  # the motion explains nothing of it


def asked(folder: Path, columns: dict[str, np.ndarray]) -> tuple[str, Path, list[str]]:
    """Message of the import of a file with a blank in its name, the map, and the command that the message gives."""
    write(folder / "run 1.csv", columns)
    ran = hil(folder, "import", "run 1.csv")
    assert ran.returncode == 2
    words = " ".join(ran.stderr.split())
    command = re.search(r"write it into the map, then: (hil import 'run 1.csv' --map 'run 1-map.yaml')", words)
    assert command, words
    return words, folder / "run 1-map.yaml", shlex.split(command[1])[1:]


def write_answers(path: Path, *answers: tuple[str, str]) -> None:
    """Write (key, line) in the places of the questions, in their order."""
    text = path.read_text()
    for key, line in answers:
        text, found = re.subn(rf"^ *{key}:   # <-- write: .*$", line, text, count=1, flags=re.MULTILINE)
        assert found, key
    path.write_text(text)


@pytest.mark.parametrize(
    ("unit", "scale"), [("rad", 1.0), ("rev", 2.0 * np.pi), ("counts\n    counts_per_rev: 500", 500)]
)
def test_the_names_of_a_motor_that_turns_stand_in_the_question(tmp_path: Path, unit: str, scale: float) -> None:
    per_unit = 2.0 * np.pi / scale if "counts" in unit else scale
    columns = {"time_s": AXIS["t"], "Weg": AXIS["angle"] / per_unit, "Kraft": AXIS["torque"]}
    words, path, command = asked(tmp_path, columns)
    assert "see above" not in words
    assert (
        "If the motor turns, write motor_position_rad in place of motor_position_m and torque_n_m in place of" in words
    )
    write_answers(path, ("unit", f"    unit: {unit}"), ("unit", '    unit: "N m"'))
    text = path.read_text()
    for new, old in re.findall(r"(\w+) in place of (\w+)", words):
        text = text.replace(f"  {old}:", f"  {new}:")
    path.write_text(text)
    assert hil(tmp_path, *command).returncode == 0
    found = read_recording(tmp_path / "run 1.parquet")
    np.testing.assert_allclose(found["motor_position_rad"], AXIS["angle"], atol=1e-4)


def test_a_column_that_is_not_found_is_asked_for_with_those_that_may_be_it(tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "speed [rpm]": AXIS["speed"] * 30.0 / np.pi, "CH2": SPIKES, "status": SPIKES}
    words, path, command = asked(tmp_path, columns)
    assert "write the name of one of: CH2 run" in words
    write_answers(path, ("column", "    column: CH2"), ("unit", '    unit: "N m"'))
    assert hil(tmp_path, *command).returncode == 0
    np.testing.assert_allclose(read_recording(tmp_path / "run 1.parquet")["torque_n_m"], SPIKES, atol=1e-6)


def test_a_motion_that_is_not_found_is_asked_for(tmp_path: Path) -> None:
    random = np.random.default_rng(2).normal(size=AXIS["t"].size)
    columns = {"time_s": AXIS["t"], "AXIS:1": random, "current [A]": SPIKES, "still": np.ones(random.size)}
    words, path, command = asked(tmp_path, columns)
    assert "measured position or velocity of the motor; write the name of one of: AXIS:1, current [A];" in words
    assert "motor_velocity_rad_s in place of motor_position_rad" in words
    write_answers(
        path,
        ("column", '    column: "AXIS:1"'),
        ("unit", "    unit: counts\n    counts_per_rev: 1000"),
        ("column", '    column: "current [A]"'),
        ("unit", "    unit: A\n    torque_constant_n_m_a: 0.5"),
    )
    assert hil(tmp_path, *command).returncode == 0
    found = read_recording(tmp_path / "run 1.parquet")
    np.testing.assert_allclose(found["motor_position_rad"], random * 2.0 * np.pi / 1000.0, atol=1e-6)
    np.testing.assert_allclose(found["torque_n_m"], 0.5 * SPIKES, atol=1e-6)


def test_a_speed_in_counts_per_second_is_told_by_the_counts_of_a_turn(tmp_path: Path) -> None:
    per_rev = AXIS["speed"] * 4000.0 / (2.0 * np.pi)
    columns = {"time_s": AXIS["t"], "actual velocity [counts/s]": per_rev, "torque_Nm": AXIS["torque"]}
    _, path, command = asked(tmp_path, columns)
    write_answers(path, ("counts_per_rev", "    counts_per_rev: 4000"))
    assert hil(tmp_path, *command).returncode == 0
    found = read_recording(tmp_path / "run 1.parquet")
    np.testing.assert_allclose(found["motor_velocity_rad_s"], AXIS["speed"], atol=1e-6)
