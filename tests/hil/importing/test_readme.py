"""A text of the owner tells what a file does not: lead, counts, torque constant, units of columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, write

from hil.commands.import_ import import_
from hil.errors import InputError
from hil.explanation import explain
from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.lexicon import Quantity
from hil.importing.readme import FileHints
from hil.importing.readme_columns import told_columns
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


@pytest.mark.long
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
    ],
)
def test_a_part_of_a_unit_is_none(words: str, unit: str) -> None:
    told = told_columns([f" a   {words}", " b - time s", " c   see below", " c   force, N"], ["a", "b", "c"])
    assert told.get("a", ("", ""))[1] == unit
    assert (told["b"][1], told["c"][1]) == ("s", "N")


def test_columns_without_a_header_are_listed_by_their_numbers() -> None:
    lines = [
        "Four columns:",
        " 1 time in s",
        " 2 encoder counts, 16384 counts per turn",
        " 4 motor current in A (kt = 0.07)",
    ]
    told = told_columns(lines, [f"column {number}" for number in range(1, 5)])
    assert {name: unit for name, (_, unit, *_) in told.items() if unit} == {
        "column 1": "s",
        "column 2": "counts",
        "column 4": "A",
    }


def test_columns_are_listed_in_a_sentence() -> None:
    lines = [
        "Columns: n = sample number, angle = table angle in degrees (ring encoder, 0.0001 deg),",
        "iq = current in A rms.",
    ]
    told = told_columns(lines, ["n", "angle", "iq"])
    assert {name: unit for name, (_, unit, *_) in told.items() if unit} == {"angle": "degrees", "iq": "A rms"}


def test_columns_are_listed_in_the_order_of_the_file() -> None:
    lines = [
        "One joint. t in seconds (2000 rows/s), qm motor angle in degrees (before the gear, 131072 counts), ql encoder",
        "after the gear in degrees (20 bit), tau motor torque in Nm at the shaft. Rated torque 0.5 Nm.",
    ]
    told = told_columns(lines, ["t", "qm", "ql", "tau"])
    assert {name: unit for name, (_, unit, *_) in told.items() if unit} == {
        "t": "seconds",
        "qm": "degrees",
        "ql": "degrees",
        "tau": "Nm",
    }
    assert told_columns(lines, ["t", "ql", "qm", "tau"]) == {}
    assert told_columns(["The motor, a belt in mm, the table in s."], ["a", "the"]) == {}


def test_a_list_has_units_in_brackets_and_sizes_of_counts() -> None:
    """0.1 % of the rated torque is a permille; a size behind "both" is also that of the column before."""
    lines = [
        "- lage_soll [mm], Sollwert",
        "- motormoment [Nm] an der Motorwelle",
        "- coppia_permille: coppia motore [0,1 % della coppia nominale], Cn = 1,27 Nm",
        "- S-0-0047 position command, S-0-0051 position feedback 1 (motor encoder, 19 bit), both 0.0001 mm",
        "- S-0-0040 velocity feedback, 0.0001 rpm (motor)",
        "- mot_inc: motor encoder, 65536 increments per motor turn",
    ]
    names = ["lage_soll", "motormoment", "coppia_permille", "S-0-0047", "S-0-0051", "S-0-0040", "mot_inc"]
    told = {name: (unit, step) for name, (_, unit, step, *_) in told_columns(lines, names).items()}
    assert told == {
        "lage_soll": ("mm", None),
        "motormoment": ("Nm", None),
        "coppia_permille": ("0,1 %", None),
        "S-0-0047": ("mm", 1e-4),
        "S-0-0051": ("mm", 1e-4),
        "S-0-0040": ("rpm", 1e-4),
        "mot_inc": ("counts", None),
    }


def test_columns_without_a_header_stand_in_a_numbered_list() -> None:
    lines = [
        " 1. time [s]",
        " 2. position command [mm]",
        " 3. motor encoder [counts], 4194304 per revolution",
        " 4. glass scale on the slide [counts], 0.2 um each, other zero than the motor",
        " 5. actual torque [% of rated], rated torque 1.95 Nm",
    ]
    told = told_columns(lines, [f"column {number}" for number in range(1, 6)])
    assert [one.unit for one in told.values()] == ["s", "mm", "counts", "um", "% of rated"]
    assert told["column 4"].step == 0.2


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "um"), (0.001, None)])
def test_a_step_is_that_of_whole_numbers(scale: float, unit: str | None, tmp_path: Path) -> None:
    """An encoder of 0.5 um whose column is not counted in it has the unit of its column."""
    counts = np.round(2e3 * AXIS["angle"])
    columns = {"t": AXIS["t"], "pos_1": scale * counts, "M": AXIS["torque"]}
    source, readme = write(tmp_path / "log.parquet", columns), tmp_path / "notes.txt"
    readme.write_text("- pos_1 scale of the slide, 0.5 um per count\n- M force [N]\n- t time [s]\n")
    entry = next(one.entry for one in draft_map(source, readme=readme).channels if one.entry["column"] == "pos_1")
    assert (entry.get("scale"), entry["unit"]) == ((0.5, unit) if unit else (None, entry["unit"]))


def test_counts_of_two_encoders_beside_a_lead_make_a_map_that_is_read(tmp_path: Path) -> None:
    columns = {"t": AXIS["t"], "motor": np.round(1e4 * AXIS["angle"]), "scale": np.round(3e4 * AXIS["angle"])}
    source, readme = write(tmp_path / "log.csv", columns | {"M": AXIS["torque"]}), tmp_path / "notes.txt"
    readme.write_text("Ball screw, lead 5 mm\n")
    draft = draft_map(source, readme=readme)
    assert (draft.lead_m, {one.key for one in draft.asked}) == (0.005, {"counts_per_rev", "counts_per_m", "unit"})
    entry = next(one.entry for one in draft.channels if one.channel == "table_position_m")
    assert entry["counts_per_m"]
    assert "counts_per_rev" not in entry  # beside a lead a map with both is refused


@pytest.mark.parametrize(
    ("said", "unit"),
    [
        ("motor encoder [counts], 65536 per rev, 10 mm lead", "counts"),
        ("motor encoder, 0 deg at the end stop, 65536 counts per turn", "counts"),
        ("motor encoder [inc], 2 ms late, 65536 inc/rev", "inc"),
        ("motor encoder counts, 65536 per turn, 24 V supply", "counts"),
        ("position [counts], 300 mm travel", "counts"),
        ("motor encoder, 10 mm belt", ""),
        ("linear scale, 20 um grating period", ""),
        ("linear scale, 5 um", ""),
    ],
)
def test_another_size_beside_a_column_is_not_that_of_its_counts(said: str, unit: str) -> None:
    told = told_columns([f"- x_1: {said}", "- t: time [s]", "- M: torque [Nm]"], ["x_1", "t", "M"])
    assert [(one.unit, one.step) for name, one in told.items() if name == "x_1"] == ([(unit, None)] if unit else [])


@pytest.mark.parametrize(
    ("line", "data", "unit"),
    [
        ("x_1: scale, 1 um", "decimals", "deg"),  # by its steps
        ("x_1 motor angle, M_1 torque Nm, both at the motor shaft", "decimals", "deg"),
        ("x_1: motor angle, each 1 A", "whole", None),
        ("x_1: scale, 1 um", "whole", "um"),
    ],
)
def test_what_cannot_be_of_a_column_is_not_taken(line: str, data: str, unit: str | None, tmp_path: Path) -> None:
    values = np.degrees(AXIS["angle"]) if data == "decimals" else np.round(1e4 * AXIS["angle"])
    columns = {"t": AXIS["t"], "x_1": values, "M_1": AXIS["torque"]}
    source, readme = write(tmp_path / "log.parquet", columns), tmp_path / "notes.txt"
    readme.write_text(f"- {line}\n- M_1: torque [Nm]\n- t: time [s]\n")
    draft = draft_map(source, readme=readme)
    entry = next(one for one in draft.channels if one.entry["column"] == "x_1")
    asked = {one.key for one in draft.asked}
    assert (entry.entry["unit"] == unit) if unit else (asked & {"unit", "counts_per_rev"})


def test_a_numbered_procedure_is_no_list_of_columns() -> None:
    lines = ["1. Wait in s", "2. Torque limit 3 [Nm]", "3. Move slowly [mm]", "2 kW servo, in Nm", "Columns"]
    lines += ["1. time [s]", "2. table position [mm]", "3. torque [Nm]"]
    told = told_columns(lines, [f"column {number}" for number in range(1, 4)])
    assert [one.unit for one in told.values()] == ["s", "mm", "Nm"]


def test_a_line_that_begins_with_a_name_goes_before_one_in_which_it_stands() -> None:
    lines = ["Maximum speed of x_1, 0.5 m/s", "x_2 - x_1 is the lag error in um", "- x_1 position in mm", "- M: Nm"]
    assert told_columns(lines, ["x_1", "x_2", "M"])["x_1"].unit == "mm"


def test_a_number_is_an_address_where_nothing_else_is_said() -> None:
    told = {"6064": Quantity.POSITION, "0x6064 act": Quantity.POSITION, "S-0-0040": Quantity.VELOCITY}
    told |= dict.fromkeys(["SN 6062", "log_6064_3", "vibration [606C]", "S-0-9999"], Quantity.UNKNOWN)
    assert {name: label(name).quantity for name in told} == told


def test_a_current_with_a_force_constant_is_that_of_a_linear_motor(tmp_path: Path) -> None:
    columns = {"t": AXIS["t"], "pos_um": np.round(1e6 * AXIS["x_act"]), "iq_A": AXIS["torque"] / CONSTANT}
    source, readme = write(tmp_path / "log.mat", columns), tmp_path / "notes.txt"
    readme.write_text(
        "t   s\npos_um   scale, um\niq_A   torque-producing current, A\n\nForce constant 95 N/A (data sheet)\n"
    )
    entries = {one.channel: one.entry for one in draft_map(source, readme=readme).channels}
    assert entries["force_n"]["force_constant_n_a"] == 95.0


def test_counts_per_turn_beside_a_column_are_its_own(tmp_path: Path) -> None:
    """A table in the README gives counts per turn for the motor's encoder and for the second one."""
    angle = AXIS["angle"]
    columns = {"t_s": AXIS["t"], "enc_m": np.round(4096 / (2.0 * np.pi) * 50.0 * angle), "par": AXIS["torque"]}
    columns["enc_eje"] = np.round(524288 / (2.0 * np.pi) * (angle - 1e-3 * AXIS["torque"]))  # behind a spring
    source, readme = write(tmp_path / "log.parquet", columns), tmp_path / "notes.md"
    readme.write_text(
        "Reductor 50:1\n\n| columna | significado |\n|---|---|\n| t_s | tiempo, s |\n| par | par del motor, Nm |\n"
        "| enc_m | encoder del motor, 4096 cuentas por vuelta |\n| `enc_eje` | encoder, 524288 cuentas por vuelta |\n"
    )
    import_(source, None, tmp_path / "out.parquet", readme=readme)
    recording = read_recording(tmp_path / "out.parquet")
    np.testing.assert_allclose(np.ptp(recording["motor_position_rad"]), 50.0 * np.ptp(angle), rtol=1e-3)
    np.testing.assert_allclose(np.ptp(recording["table_position_m"]), np.ptp(angle), rtol=0.01)


def test_counts_of_the_motor_are_not_measured_where_they_are_told(tmp_path: Path) -> None:
    motor = AXIS["angle"]
    columns = {"t": AXIS["t"], "Geber1_Motor": np.round(4096 / (2.0 * np.pi) * motor), "M": AXIS["torque"]}
    columns["Geber2"] = np.round(1.0001 * 0.035904 / (2.0 * np.pi) * motor / 5e-6)
    source, readme = write(tmp_path / "log.parquet", columns), tmp_path / "notes.txt"
    lines = ["35,904 mm je Motorumdrehung", "- t: s", "- Geber1_Motor: 4096 Ink je Motorumdrehung"]
    readme.write_text("\n".join([*lines, "- Geber2: Maßstab, 1 Ink = 5 µm", "- M: Moment, Nm", ""]))
    entries = {one.channel: one.entry for one in draft_map(source, readme=readme).channels}
    assert entries["motor_position_rad"]["counts_per_rev"] == 4096


@pytest.mark.parametrize(
    ("said", "per_turn"),
    [
        ("motor encoder, 65536 counts per turn", 65536),
        ("Geber, 4096 Ink je Motorumdrehung", 4096),
        ("encoder, 4096 cuentas por vuelta de motor", 4096),
        ("codeur, 8192 incréments par tour", 8192),
        ("scale of the slide, 1000 counts per mm", None),
        ("linear motor, 200 inc/mm", None),
    ],
)
def test_counts_per_length_are_none_per_turn(said: str, per_turn: int | None) -> None:
    told = told_columns([f"- x_1: {said}", "- t: time [s]", "- M: torque [Nm]"], ["x_1", "t", "M"])
    assert (told["x_1"].per_turn if "x_1" in told else None) == per_turn
