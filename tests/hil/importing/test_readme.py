"""A text of the owner tells what a file does not: lead, counts, torque constant, units of columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, write

from hil.commands.import_ import import_
from hil.errors import InputError
from hil.explanation import explain
from hil.importing.draft_map import draft_map
from hil.importing.readme import FileHints, _listed
from hil.recording.recording import read_recording

AXIS = axis()
COUNTS, CONSTANT = 4096, 0.25
COLUMNS = {
    "time_s": AXIS["t"],
    "pos_inc": np.round(AXIS["angle"] / (2.0 * np.pi) * COUNTS),
    "iq_A": AXIS["torque"] / CONSTANT,
}
TEXT = f"""Lifting axis of the test rig, belt removed.

pos_inc   encoder of the motor, {COUNTS} increments per turn
iq_A      current, measured
torque constant {CONSTANT} Nm/A (data sheet)
"""


@pytest.fixture(params=["csv", "parquet", "mat", "json"])
def source(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return write(tmp_path / f"log.{request.param}", COLUMNS)


@pytest.fixture
def readme(tmp_path: Path) -> Path:
    path = tmp_path / "README.txt"
    path.write_text(TEXT)
    return path


def test_sizes_of_a_readme_are_those_of_the_file(source: Path, readme: Path, tmp_path: Path) -> None:
    assert [one.key for one in draft_map(source).asked] == ["counts_per_rev", "torque_constant_n_m_a"]
    assert not draft_map(source, readme=readme).asked
    import_(source, None, tmp_path / "out.parquet", readme=readme)
    recording = read_recording(tmp_path / "out.parquet")
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"], atol=2.0 * np.pi / COUNTS)
    np.testing.assert_allclose(recording["torque_n_m"], AXIS["torque"], atol=1e-6)


def test_what_the_file_says_goes_first(readme: Path, tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", COLUMNS)
    path.write_text("# torque constant 0.5 Nm/A\n" + path.read_text())
    entries = {one.channel: one.entry for one in draft_map(path, readme=readme).channels}
    assert entries["torque_n_m"]["torque_constant_n_m_a"] == 0.5
    assert entries["motor_position_rad"]["counts_per_rev"] == COUNTS


def test_units_of_columns_are_read(tmp_path: Path) -> None:
    path = write(tmp_path / "log.parquet", {"t": AXIS["t"], "phi": np.rad2deg(AXIS["angle"]), "M": AXIS["torque"]})
    text = tmp_path / "notes.md"
    text.write_text("t [s], phi angle of the motor [deg], M torque [Nm]\n", encoding="cp1252")
    units = {one.channel: one.entry["unit"] for one in draft_map(path, readme=text).channels}
    assert units == {"motor_position_rad": "deg", "torque_n_m": "N m"}


def test_a_readme_that_is_not_there_is_refused(source: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file; give a text of the owner"):
        draft_map(source, readme=tmp_path / "none.txt")


def test_a_map_knows_the_readme_that_it_was_drafted_with(readme: Path, tmp_path: Path) -> None:
    source = write(tmp_path / "log.csv", COLUMNS)
    first = explain(source, tmp_path / "explained", readme=readme)
    (the_map,) = (tmp_path / "explained").glob("*-map.yaml")
    assert the_map.read_text().splitlines()[-1] == f"# Drafted with: --readme {readme}"
    again = explain(source, tmp_path / "explained", readme=readme)
    assert not first.basis.unsized
    assert not again.basis.unsized
    with pytest.raises(InputError, match="was not drafted with --rate 500"):
        explain(source, tmp_path / "explained", rate_hz=500.0)


def test_options_tell_what_the_user_told() -> None:
    told = FileHints(500.0, "2", Path("README.txt"))
    words = told.options
    assert FileHints.of(dict(zip(words[::2], words[1::2], strict=True))) == told
    assert FileHints().options == []


def test_a_unit_stands_among_the_words_of_a_column(tmp_path: Path) -> None:
    """It begins or ends a phrase without a number; a distance meter and an article are no units."""
    ratio, angle = 100, np.degrees(AXIS["angle"])
    columns = {"t": AXIS["t"], "q_cmd": angle / ratio, "q_mot": np.round(angle, 2), "i": AXIS["torque"] / CONSTANT}
    source, readme = write(tmp_path / "log.csv", columns), tmp_path / "joint.txt"
    readme.write_text(
        "Elbow joint, harmonic drive 100:1, torque constant 0.25 Nm/A\n"
        " t      time s\n"
        " q_cmd  commanded angle of the meter on the joint, degrees (joint side)\n"
        " q_mot  motor encoder (16 bit), degrees of the MOTOR shaft\n"
        " i      motor current A, measured\n"
    )
    entries = {one.channel: one.entry for one in draft_map(source, readme=readme).channels}
    units = {entries[name]["column"]: entries[name]["unit"] for name in entries}
    assert units == {"q_cmd": "deg", "q_mot": "deg", "i": "A"}


@pytest.mark.parametrize(
    ("words", "unit"),
    [
        ("motor torque in N m", "N m"),
        ("torque, Newton meters of the motor", "Newton meters"),
        ("motor speed, degrees per second", ""),
        ("revolutions per minute", ""),
        ("second encoder", ""),
        ("position of the first turn", ""),
        ("angle, degrees of the joint", "degrees"),
        ("5 um steps", ""),
    ],
)
def test_a_part_of_a_unit_is_none(words: str, unit: str) -> None:
    told = _listed([f" a   {words}", " b - time s", " c   see below", " c   force, N"], ["a", "b", "c"])
    assert told.get("a", ("", ""))[1] == unit
    assert (told["b"][1], told["c"][1]) == ("s", "N")


def test_columns_without_a_header_are_listed_by_their_numbers() -> None:
    lines = [
        "Four columns:",
        " 1 time in s",
        " 2 encoder counts, 16384 counts per turn",
        " 4 motor current in A (kt = 0.07)",
    ]
    told = _listed(lines, [f"column {number}" for number in range(1, 5)])
    assert {name: unit for name, (_, unit) in told.items()} == {"column 1": "s", "column 2": "counts", "column 4": "A"}


def test_columns_are_listed_in_a_sentence() -> None:
    lines = [
        "Columns: n = sample number, angle = table angle in degrees (ring encoder, 0.0001 deg),",
        "iq = current in A rms.",
    ]
    told = _listed(lines, ["n", "angle", "iq"])
    assert {name: unit for name, (_, unit) in told.items()} == {"angle": "degrees", "iq": "A rms"}


def test_columns_are_listed_in_the_order_of_the_file() -> None:
    lines = [
        "One joint. t in seconds (2000 rows/s), qm motor angle in degrees (before the gear, 131072 counts), ql encoder",
        "after the gear in degrees (20 bit), tau motor torque in Nm at the shaft. Rated torque 0.5 Nm.",
    ]
    told = _listed(lines, ["t", "qm", "ql", "tau"])
    assert {name: unit for name, (_, unit) in told.items()} == {
        "t": "seconds",
        "qm": "degrees",
        "ql": "degrees",
        "tau": "Nm",
    }
    assert _listed(lines, ["t", "ql", "qm", "tau"]) == {}
    assert _listed(["The motor, a belt in mm, the table in s."], ["a", "the"]) == {}
