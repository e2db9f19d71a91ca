"""Sizes in a text of the owner: equations, shares of a current, counts of a second encoder, parts of the mass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from foreign_axis import axis, write

from hil.arrays import FloatArray
from hil.commands.import_ import import_
from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.foreign_table import read_table
from hil.importing.lexicon import Quantity
from hil.importing.map_text import map_text
from hil.importing.readme import with_readme
from hil.importing.readme_columns import told_columns
from hil.recording.recording import read_recording

AXIS = axis()
CONSTANT = 0.25


@pytest.mark.parametrize(
    ("line", "size"),
    [
        ("trq - 0.1 % of rated torque (1000 = 3.2 Nm)", 3.2e-3),
        ("trq: actual torque, 1 count = 2 mNm", 2e-3),
        ("trq - counts (1,000 counts = 3.2 Nm)", 3.2e-3),
        ("trq: motor torque, LSB 0.002 Nm", 2e-3),
    ],
)
def test_an_equation_tells_the_size_of_a_number(line: str, size: float, tmp_path: Path) -> None:
    """Nor is a number of the file the rated torque."""
    raw = AXIS["torque"] / size
    path = write(tmp_path / "log.csv", {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "trq": np.round(raw)})
    (tmp_path / "README.md").write_text(f"Axis with a motor of 3.2 Nm rated torque.\n- pos_rad: rad\n- {line}\n")
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    found = read_recording(tmp_path / "out.parquet")["torque_n_m"]
    np.testing.assert_allclose(found, AXIS["torque"], atol=size)


def test_a_share_of_the_rated_torque_is_told_by_an_equation(tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "phi[deg]": np.degrees(AXIS["angle"]), "M[%MN]": AXIS["torque"] / 0.032}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(
        "  phi[deg]  angle, deg\n  M[%MN]    torque in percent of rated (100 = 3.2 Nm)\n"
    )
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    np.testing.assert_allclose(read_recording(tmp_path / "out.parquet")["torque_n_m"], AXIS["torque"], atol=1e-6)


@pytest.mark.parametrize("told", ["- pos_cnt: linear scale, 0.1 um per count\n- i: A\n", "1. scale, 0.1 um\n2. A\n"])
def test_the_size_of_a_count_goes_before_the_word_counts_in_a_name(told: str, tmp_path: Path) -> None:
    """A list with a number for each column tells it, too."""
    pos_m = 0.001 * AXIS["angle"]
    path = write(tmp_path / "log.csv", {"pos_cnt": np.round(pos_m * 1e7), "i": AXIS["torque"]})
    (tmp_path / "README.md").write_text(f"Linear motor, 2 N/A, logged at {1.0 / AXIS['t'][1]:g} Hz.\n\n{told}")
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    found = read_recording(tmp_path / "out.parquet")
    np.testing.assert_allclose(found["motor_position_m"], pos_m, atol=1e-7)
    assert found.period_s == pytest.approx(AXIS["t"][1])


@pytest.mark.parametrize(
    "told",
    ["2^21 counts per rev", "2**21 Inc = 1 rev", "2097152 counts = 1 turn", "2097152 Inc = 1 Motorumdrehung = 4 mm"],
)
def test_counts_of_a_turn_may_be_a_power_or_an_equation(told: str, tmp_path: Path) -> None:
    counts = np.round(AXIS["angle"] / (2.0 * np.pi) * 2**21)
    path = write(tmp_path / "log.csv", {"time_s": AXIS["t"], "pos_inc": counts, "torque_Nm": AXIS["torque"]})
    (tmp_path / "README.md").write_text(f"- pos_inc: motor encoder, {told}\n- torque_Nm: torque, Nm\n")
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    found = read_recording(tmp_path / "out.parquet")["motor_position_rad"]
    np.testing.assert_allclose(found - found[0], AXIS["angle"] - AXIS["angle"][0], atol=1e-5)


@pytest.mark.parametrize("name", ["scale_nm", "pos_nm"])
def test_a_linear_scale_in_nm_is_in_nanometres(name: str) -> None:
    assert (label(name).quantity, label(name).unit) == (Quantity.POSITION, "nm")


@pytest.mark.parametrize("name", ["load_nm", "motor_scaled_Nm", "full_scale_Nm", "M_scaled [Nm]", "tape_load_Nm"])
def test_a_torque_is_in_newton_metres(name: str) -> None:
    assert (label(name).quantity, label(name).unit) == (Quantity.EFFORT, "N m")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("speed, 10 counts = 1 rev/min", ("rev/min", 0.1, None)),
        ("angle, 4096 Inc = 1 rev", ("rev", 1 / 4096, None)),
        ("table position, 0.0001 mm (100000 counts = 1 rev = 10 mm)", ("mm", 0.0001, None)),
        ("motor encoder, counts, 0.2 um each, 50000 counts = 1 turn", ("um", 0.2, None)),
        ("motor encoder, 65536 Inc = 1 electrical turn (4 pole pairs)", ("", None, None)),
        ("motor encoder, 524288 Inc = 1 rev (+ = +X)", ("counts", None, 524288)),
        ("Lage in Inc, 10000 Inc = 1 Motorumdrehung = 4 mm", ("Inc", None, 10000)),
    ],
)
def test_what_an_equation_tells(text: str, expected: tuple[str, float | None, int | None]) -> None:
    told = told_columns([f"- pos_x: {text}", "- trq_x: torque, Nm"], ["pos_x", "trq_x"]).get("pos_x")
    found = ("", None, None) if told is None else (told.unit, told.step, told.per_turn)
    assert found == (expected[0], pytest.approx(expected[1]) if expected[1] else None, expected[2])


@pytest.mark.parametrize(
    "of", ["torque in percent of rated torque (1000 = 3.2 Nm)", "torque in percent, 16384 digits = 16 A"]
)
def test_an_equation_of_other_numbers_is_not_applied_to_a_share(of: str, tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "trq_%": np.round(AXIS["torque"] / 0.032, 2)}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(f"- pos_rad: rad\n- trq_%: {of}\n")
    channels = yaml.safe_load(map_text(draft_map(path, readme=tmp_path / "README.md")))["channels"]
    assert channels["torque_n_m"]["unit"] == "%"
    assert "scale" not in channels["torque_n_m"]


@pytest.mark.parametrize("whole", ["largest current 40 A (= 100 % TRQ)", "100 % = 40 A"])
def test_a_share_of_a_current_is_a_torque_by_the_constant_of_the_motor(whole: str, tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "trq_%": AXIS["torque"] / (40.0 * 1.1) * 100.0}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(f"torque constant 1.1 N m/A\n{whole}\n")
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    np.testing.assert_allclose(read_recording(tmp_path / "out.parquet")["torque_n_m"], AXIS["torque"], atol=1e-6)


def test_a_second_encoder_has_its_own_counts_against_its_name(tmp_path: Path) -> None:
    """The owner calls columns by the last part of their names; the joint turns a tenth of the motor."""
    counts = {"log.Pos [cnt]": (65536, 1.0), "log.Aux [cnt]": (524288, 0.1)}
    columns = {name: np.round(share * AXIS["angle"] / (2.0 * np.pi) * per) for name, (per, share) in counts.items()}
    path = write(tmp_path / "log.csv", {"time_s": AXIS["t"], **columns, "log.iq [A]": AXIS["torque"] / CONSTANT})
    (tmp_path / "README.md").write_text(
        f"torque constant {CONSTANT} Nm/A\n- Pos [cnt]: motor encoder, 65536 cnt per motor turn\n"
        "- Aux [cnt]: joint encoder at the output, 524288 cnt per turn of the joint\n"
    )
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    found = read_recording(tmp_path / "out.parquet")
    np.testing.assert_allclose(found["motor_position_rad"], AXIS["angle"], atol=1e-3)
    np.testing.assert_allclose(found["table_position_m"], 0.1 * AXIS["angle"], atol=1e-4)


def test_a_counter_that_follows_the_motor_is_an_encoder(tmp_path: Path) -> None:
    columns = {
        "time_s": AXIS["t"],
        "Axis1.Pos_rad": AXIS["angle"],
        "Axis1.Torque_Nm": AXIS["torque"],
        "EL5151.CounterValue": np.round(AXIS["angle"] * 0.03 / (2.0 * np.pi) * 20000.0) + 47200,
    }
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(
        "Motor 30.0 mm per motor revolution.\nA draw-wire encoder, 20 increments per mm.\n"
        "* Axis1.Pos_rad - rad\n* EL5151.CounterValue - increments of the draw-wire\n"
    )
    entries = {one.channel: one.entry for one in draft_map(path, readme=tmp_path / "README.md").channels}
    assert entries["table_position_m"] == {"column": "EL5151.CounterValue", "unit": "counts", "counts_per_m": 20000.0}


def test_a_restated_inertia_is_read_once(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "trq_Nm": AXIS["torque"]})
    (tmp_path / "README.md").write_text(
        "motor + wave gen.  1.62e-4 kg m^2 at the motor shaft (= 1.62 kg m^2 at the joint)\n"
        "arm                4.5 kg, centre of mass at 0.38 m, inertia about the axis 0.90 kg m^2\n"
    )
    told = draft_map(path, readme=tmp_path / "README.md").table.constants
    found = {constant.value: one.value for constant, one in told.items()}
    assert found == {"motor_inertia_kg_m2": 1.62e-4, "load_inertia_kg_m2": 0.9, "load_mass_kg": 4.5}


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("enc: motor encoder, 1.048.576 = 360 deg", ("", None)),  # points of thousands are doubtful
        ("enc: motor angle in mrad, detent 1 = 7 mrad", ("mrad", None)),
        ("enc: motor speed in rpm, 3000 = 10 V", ("rpm", None)),
        ("enc: status, 1 = 0 V", ("", None)),
        ("enc: recorded 2024 = 5 s", ("", None)),
        ("enc: position counts, 10,000 counts = 360 deg", ("deg", 0.036)),
    ],
)
def test_an_equation_that_is_no_size_is_left_alone(line: str, told: tuple[str, float | None]) -> None:
    found = told_columns([f"- {line}", "- t: s", "- M: Nm"], ["enc", "t", "M"]).get("enc")
    assert (("", None) if found is None else (found.unit, found.step)) == told


def test_the_rest_of_a_line_with_a_whole_is_read(tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "trq_%": AXIS["torque"] / 2.4 * 100.0}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(
        "Motor: rated torque 2.4 Nm, rated current 4.5 A (= 100 %)\ntorque constant 0.6 Nm/A\n"
    )
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    np.testing.assert_allclose(read_recording(tmp_path / "out.parquet")["torque_n_m"], AXIS["torque"], atol=1e-6)


@pytest.mark.parametrize("unit", ["rad", "counts"])
def test_counts_of_a_second_encoder_are_those_of_whole_numbers(unit: str, tmp_path: Path) -> None:
    """A unit of the file that is no count stands."""
    joint = 0.1 * AXIS["angle"]
    columns = {"t": AXIS["t"], "Pos": np.round(AXIS["angle"] / (2.0 * np.pi) * 65536), "M": AXIS["torque"]}
    columns["Aux"] = joint if unit == "rad" else np.round(joint / (2.0 * np.pi) * 524288)
    path = write(tmp_path / "log.csv", columns)
    head, _, rest = path.read_text().partition("\n")
    path.write_text(f"{head}\ns,counts,Nm,{unit}\n{rest}")
    (tmp_path / "README.md").write_text(
        "- Pos: motor encoder, 65536 counts per motor turn\n"
        "- Aux: joint encoder at the output, 524288 counts per turn of the joint\n"
    )
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    np.testing.assert_allclose(read_recording(tmp_path / "out.parquet")["table_position_m"], joint, atol=1e-4)


@pytest.mark.parametrize(
    "line",
    ["The load was taken off. 12 kg", "Load mass: see sec. 4.5 kg", "motor 2.1 kg, arm 4.5 kg, inertia 0.9 kg m^2"],
)
def test_a_number_of_another_thing_is_no_inertia_of_a_part(line: str, tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "trq_Nm": AXIS["torque"]})
    (tmp_path / "README.md").write_text(f"{line}\n")
    told = {one.value for one in draft_map(path, readme=tmp_path / "README.md").table.constants}
    assert not told & {"motor_inertia_kg_m2", "load_inertia_kg_m2"}
    assert "arm" in line or not told


def test_samples_apart_tell_the_rate_of_a_file_without_a_header(tmp_path: Path) -> None:
    columns = np.column_stack([np.arange(AXIS["t"].size), np.degrees(AXIS["angle"]), AXIS["torque"]])
    np.savetxt(tmp_path / "trace.csv", columns, delimiter=",", fmt="%.6f")
    (tmp_path / "README.md").write_text(
        "No header. Columns:\n1. sample number, 2 ms apart\n2. motor encoder in deg\n3. motor torque in Nm\n"
    )
    import_(tmp_path / "trace.csv", None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    assert read_recording(tmp_path / "out.parquet").period_s == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("line", "size"),
    [
        ("torque_V   amplifier output of the torque shaft, 2 Nm/V, 12 bit", 2.0),
        ("torque_V: torque shaft, 0.5 N m per V", 0.5),
    ],
)
def test_a_ratio_to_volts_is_the_scale_of_a_column_in_volts(line: str, size: float, tmp_path: Path) -> None:
    """It is a measured torque then, and no command in volts."""
    columns = {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "torque_V": AXIS["torque"] / size}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(f"- pos_rad: rad\n{line}\nThe brake needs 8 Nm/V.\n")
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    np.testing.assert_allclose(read_recording(tmp_path / "out.parquet")["torque_n_m"], AXIS["torque"], atol=1e-6)


def test_a_table_tells_what_a_volt_of_each_channel_of_a_scope_is(tmp_path: Path) -> None:
    """The file says V of none of them, and what it holds are no whole numbers."""
    columns = {"TIME": AXIS["t"], "CH1": np.degrees(AXIS["angle"]) / 36.0, "CH2": AXIS["torque"] / 0.6 / 2.0}
    path = write(tmp_path / "scope.csv", columns)
    (tmp_path / "README.md").write_text(
        "Torque motor 0.6 Nm/A\n\n| channel | signal | scale |\n|---|---|---|\n"
        "| CH1 | table angle potentiometer | 36 degrees per V |\n| CH2 | armature current | 2 A per V |\n"
    )
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    recording = read_recording(tmp_path / "out.parquet")
    np.testing.assert_allclose(np.ptp(recording["motor_position_rad"]), np.ptp(AXIS["angle"]), rtol=1e-4)
    np.testing.assert_allclose(recording["torque_n_m"], AXIS["torque"], atol=1e-5)


def test_sentences_tell_columns_whose_names_are_words() -> None:
    lines = ["Pos act in mm. I act in drive digits: 16384 digits = 16 A. Positive current pushes.", "1 turn = 5 mm."]
    told = told_columns(lines, ["Idx", "Pos act", "I act"])
    assert told["Pos act"].unit == "mm"
    assert (told["I act"].unit, told["I act"].step) == ("A", 16.0 / 16384.0)


def test_a_sentence_lists_columns_with_units_in_brackets() -> None:
    lines = ["Columns: stamp_ns (unix ns, wobbling), position (rad, joint side, 4096 counts / motor rev), current (A)."]
    told = told_columns(lines, ["stamp_ns", "position", "current"])
    assert {name: one.unit for name, one in told.items()} == {"stamp_ns": "ns", "position": "rad", "current": "A"}


@pytest.mark.parametrize(
    "line",
    [
        "- torque: measured torque in Nm (transducer 2 Nm/V)",
        "- torque: measured torque [Nm]. The brake needs 8 Nm/V.",
        "- torque: measured, 1 pitch = 5 mm, in Nm",
        "- torque: torque in Nm, motor 60 rpm/V",
    ],
)
def test_a_plain_unit_goes_before_ratios_of_something_else(line: str) -> None:
    told = told_columns(["- pos: rad", line], ["pos", "torque"])["torque"]
    assert (told.unit, told.step) == ("Nm", None)


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("a_1 akt. Lage in mm, b_2 Drehm. Ist in Nm", {"a_1": "mm", "b_2": "Nm"}),
        ("Lage in mm. Moment in Nm. Spalten: t = Zeit in s, Lage = Winkel in deg", {"t": "s", "Lage": "deg"}),
    ],
)
def test_sentences_do_not_hide_lists(line: str, units: dict[str, str]) -> None:
    assert {name: one.unit for name, one in told_columns([line], list(units)).items()} == units


@pytest.mark.parametrize("counts", ["3 600 000 inc per table revolution", "3600000 increments / table turn"])
def test_counts_of_a_turn_of_the_load_may_be_told_beside_the_column(counts: str, tmp_path: Path) -> None:
    turned = AXIS["angle"] / 90.0
    columns = {"time_s": AXIS["t"], "motor_inc": np.round(AXIS["angle"] / (2.0 * np.pi) * 8192)}
    columns |= {"table_inc": np.round(turned / (2.0 * np.pi) * 3.6e6) + 1184453, "torque_Nm": AXIS["torque"]}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(f"- motor encoder 8192 inc/rev\n- ring encoder, {counts}\n- worm 90:1\n")
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    found = read_recording(tmp_path / "out.parquet")["table_position_m"]
    np.testing.assert_allclose(found - found[0], turned - turned[0], atol=2e-6)


def test_a_text_may_give_one_name_to_the_columns_of_several_runs(tmp_path: Path) -> None:
    columns = dict[str, FloatArray]()
    for run in "AB":
        columns |= {f"run{run}_t": AXIS["t"], f"run{run}_mot_inc": np.round(AXIS["angle"] / (2.0 * np.pi) * 8192)}
        columns |= {f"run{run}_joint_inc": np.round(AXIS["angle"] / 101.0 / (2.0 * np.pi) * 2**20)}
        columns |= {f"run{run}_i_A": np.round(AXIS["torque"] / 0.0905, 3)}
    path = write(tmp_path / "log.csv", columns)
    (tmp_path / "README.md").write_text(
        "    runX_t          s\n"
        "    runX_mot_inc    motor encoder, 8192 increments per motor revolution (after x4)\n"
        "    runX_joint_inc  output encoder, 2^20 increments per revolution of the joint\n"
        "    runX_i_A        current, A\n\n    torque constant 0.0905 Nm/A\n"
    )
    import_(path, None, tmp_path / "out.parquet", readme=tmp_path / "README.md")
    found = read_recording(tmp_path / "out.parquet")
    np.testing.assert_allclose(found["motor_position_rad"], AXIS["angle"], atol=4e-4)
    np.testing.assert_allclose(np.ptp(found["table_position_m"]), np.ptp(AXIS["angle"]) / 101.0, rtol=1e-3)


@pytest.mark.parametrize(("words", "unit", "scale"), [("voltage in V", "V", 1.0), ("tacho", "rpm", 60.0)])
def test_the_speed_constant_of_a_motor_is_no_scale_of_its_voltage(
    words: str, unit: str, scale: float, tmp_path: Path
) -> None:
    path = write(tmp_path / "log.csv", {"time_s": AXIS["t"], "pos_rad": AXIS["angle"], "u": AXIS["torque"]})
    (tmp_path / "README.md").write_text(f"- pos_rad: rad\n- u: {words}, 60 rpm/V\n")
    table = with_readme(read_table(path), tmp_path / "README.md")
    assert table.units["u"] == unit
    assert table.scales.get("u", (1.0, 0.0))[0] == scale
