"""Units and words of columns in lines above the numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import LEAD_M, axis, csv_text, renamed

from hil.importing.draft_map import draft_map
from hil.importing.unit_lines import described, told_units

AXIS = axis()
NAMES = ("t", "set", "act", "n", "M")


@pytest.mark.parametrize(
    "line",
    [
        "# units: s, mm, mm, rpm, Nm",
        "Units: s / mm / mm / rpm / Nm",
        "Einheit: s;mm;mm;rpm;Nm",
        "# mm, mm, rpm, Nm",
        "#s mm mm rpm Nm",
        "[s] | [mm] | [mm] | [rpm] | [Nm]",
    ],
)
def test_a_list_of_units_is_that_of_the_columns_or_of_those_without_the_time(line: str) -> None:
    units = told_units(["a log of Monday", line], NAMES)
    assert {name: units[name] for name in NAMES[1:]} == {"set": "mm", "act": "mm", "n": "rpm", "M": "Nm"}


def test_a_shorter_list_has_the_unit_of_each_quantity() -> None:
    units = told_units(["#rad, rad/s, A"], ["TIME", "PHI_REF", "PHI", "OMEGA", "I_Q", "U_Q", "torque_Nm"])
    assert units == {"PHI_REF": "rad", "PHI": "rad", "OMEGA": "rad/s", "I_Q": "A"}


@pytest.mark.parametrize("line", ["s,v,a", "# recorded on Monday", "# axis 2, 5 mm", "machine=T5", "s"])
def test_another_line_is_no_list_of_units(line: str) -> None:
    assert told_units([line], ["s", "v", "a"]) == {}


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("c1 time [ms] | c2 motor [inc 65536/rev] | c3 torque command [Nm]", ["ms", "inc", "Nm"]),
        ("% c1 time s, c2 motor encoder mm, c3 Nm", ["s", "mm", "Nm"]),
        ("## c1 [s]  c2 motor shaft [cnt, 4000/rev]  c3 [A]", ["s", "cnt", "A"]),
    ],
)
def test_columns_are_described_in_turn(line: str, wanted: list[str]) -> None:
    told = described(["log 7", line], ["c1", "c2", "c3"])
    assert [unit for _, unit in told.values()] == wanted
    assert told["c2"][0].startswith("motor")


def test_a_line_for_each_column_may_end_with_its_unit() -> None:
    lines = [
        "# COL 1  TIME      s",
        "# COL 2  POS.CMD   mm",
        "# COL 3  POS.ACT   mm",
        "# COL 4  TRQ.ACT   %",
        "# POS.ACT TRQ.ACT",
    ]
    told = described(lines, ["TIME", "POS.CMD", "POS.ACT", "TRQ.ACT"])
    assert {name: unit for name, (_, unit) in told.items()} == {
        "TIME": "s", "POS.CMD": "mm", "POS.ACT": "mm", "TRQ.ACT": "%",
    }  # fmt: skip


@pytest.mark.parametrize(
    "line",
    ['"Channel {number}","{name}","{unit}","1"', "Channel\t{name}\tunit_string\t{unit}", "CH {number}; {name}; {unit}"],
)
def test_a_line_for_each_column_may_begin_with_the_word_of_a_channel(line: str) -> None:
    units = {"PosSet": "mm", "PosAct": "mm", "SpeedAct": "rpm"}
    lines = [line.format(number=k, name=name, unit=unit) for k, (name, unit) in enumerate(units.items(), 1)]
    told = described([*lines, "PosSet PosAct SpeedAct"], list(units))
    assert {name: unit for name, (_, unit) in told.items()} == units


@pytest.mark.parametrize("line", ["c1,c2,c3", "c1 was 5 mm, c2 = 3 s", "about c1 and c2"])
def test_prose_describes_no_column(line: str) -> None:
    assert described([line], ["c1", "c2", "c3"]) == {}


def test_a_described_file_is_read_as_described(tmp_path: Path) -> None:
    columns = renamed(AXIS | {"t": 1e3 * AXIS["t"]}, t="ch1", x_set="ch2", angle="ch3", torque="ch4")
    path = tmp_path / "log.csv"
    path.write_text(csv_text(columns, above="ch1 time [ms] | ch2 set [mm] | ch3 motor [rad] | ch4 torque [Nm]\n"))
    found = {one.channel: one.entry for one in draft_map(path).channels}
    assert (found["position_command_m"]["column"], found["position_command_m"]["unit"]) == ("ch2", "mm")
    assert (found["motor_position_rad"]["unit"], found["torque_n_m"]["unit"]) == ("rad", "N m")


@pytest.mark.parametrize("above", ["# units: s, mm, rad, Nm\n", ""])
def test_a_line_of_units_with_its_word_is_no_header(tmp_path: Path, above: str) -> None:
    columns = renamed(AXIS, t="time", x_set="set_pos", angle="act_pos", torque="torque")
    path = tmp_path / "log.csv"
    path.write_text(csv_text(columns, above=above, below="" if above else "# units: s, mm, rad, Nm\n"))
    draft = draft_map(path)
    found = {one.channel: one.entry for one in draft.channels}
    assert (found["motor_position_rad"]["column"], found["motor_position_rad"]["unit"]) == ("act_pos", "rad")
    assert draft.lead_m == pytest.approx(LEAD_M, rel=1e-3)


@pytest.mark.parametrize("lead", ["# axis 2, lead 10 mm\n", "; ball screw lead 10 mm; motor direct\n"])
def test_a_lead_within_a_comment_turns_a_length_into_the_motor_s_angle(tmp_path: Path, lead: str) -> None:
    columns = renamed(AXIS, t="time_s", x_set="pos_set_mm", x_act="pos_mm", torque="torque_Nm")
    path = tmp_path / "log.csv"
    path.write_text(csv_text(columns, above=lead))
    draft = draft_map(path)
    found = {one.channel: one.entry for one in draft.channels}
    assert draft.lead_m == LEAD_M
    assert found["motor_position_rad"]["unit"] == "mm"
    assert found["torque_n_m"]["unit"] == "N m"


def test_without_a_lead_it_is_asked(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="time_s", x_set="pos_set_mm", x_act="pos_mm", torque="torque_Nm")
    path = tmp_path / "log.csv"
    path.write_text(csv_text(columns))
    assert [(one.channel, one.key) for one in draft_map(path).asked] == [("", "lead_m")]


def test_attributes_of_an_xml_file_may_be_german(tmp_path: Path) -> None:
    path = tmp_path / "log.xml"
    channels = (("k1", "Lageistwert", "rad", AXIS["angle"]), ("k2", "Stromsollwert", "mA", 1e3 * AXIS["torque"]))
    about = "".join(f'<Kanal id="{key}" name="{name}" Einheit="{unit}"/>' for key, name, unit, _ in channels)
    rows = "".join(
        f'<W t="{t:.4f}" k1="{a:.6f}" k2="{i:.3f}"/>'
        for t, a, i in zip(AXIS["t"], channels[0][3], channels[1][3], strict=True)
    )
    path.write_text(f"<Aufzeichnung><Kanaele>{about}</Kanaele><Werte>{rows}</Werte></Aufzeichnung>")
    found = {one.channel: one.entry for one in draft_map(path).channels}
    assert (found["motor_position_rad"]["column"], found["motor_position_rad"]["unit"]) == ("Lageistwert", "rad")
    current = next(entry for entry in found.values() if entry["column"] == "Stromsollwert")
    assert (current["unit"], current["scale"]) == ("A", 0.001)


CHANNEL_LIST = """*** DRIVE TRACE ***
Device;ZX-210
SamplePeriod;1.000 ms
CH1;P-0-0051;Pos.feedback 1;mm;scale 0.001
CH2;S-0-0047;Pos.command;mm;scale 0.001
CH3;S-0-0040;Vel.feedback;rpm;factor=0.1
CH4;S-0-0084;Torque feedback;Nm;scale 0.01
[DATA]
"""


@pytest.mark.parametrize(
    ("names", "ending", "delimiter", "mark"),
    [
        ("#;CH1;CH2;CH3;CH4", "trc", ";", "."),
        ("No;CH1;CH2;CH3;CH4", "txt", ";", "."),
        ("#;CH1;CH2;CH3;CH4", "", ";", ","),
        ("#;CH1;CH2;CH3;CH4", "trc", "\t", "."),
    ],
)
def test_rows_that_describe_a_channel_each_are_no_names(
    tmp_path: Path, names: str, ending: str, delimiter: str, mark: str
) -> None:
    """As many fields as the columns have; unit and factor of each channel, in a file with an ending of its own."""
    columns = [1e3 * AXIS["x_act"], 1e3 * AXIS["x_set"], AXIS["speed"] * 300.0 / np.pi, AXIS["torque"] * 100.0]
    whole = [[index, *(round(float(one[index])) for one in columns)] for index in range(AXIS["t"].size)]
    source = tmp_path / f"trace.{ending}".rstrip(".")
    above = CHANNEL_LIST.replace("0.", f"0{mark}") + names + "\n"
    source.write_text((above + "".join(";".join(map(str, row)) + "\n" for row in whole)).replace(";", delimiter))
    draft = draft_map(source)
    entries = {one.channel: one.entry for one in draft.channels}
    assert {name: str(entry["column"]) for name, entry in entries.items()} == {
        "motor_position_rad": "CH1",
        "position_command_m": "CH2",
        "torque_n_m": "CH4",
    }
    assert entries["motor_position_rad"]["unit"] == "mm"
    assert entries["motor_position_rad"]["scale"] == pytest.approx(1e-3)
    assert entries["torque_n_m"]["scale"] == pytest.approx(1e-2)
    assert draft.lead_m == pytest.approx(LEAD_M)


def test_a_list_of_channels_with_a_field_less_than_the_rows_gives_their_units(tmp_path: Path) -> None:
    columns = [AXIS["x_act"], AXIS["x_set"], AXIS["speed"] * 30.0 / np.pi, AXIS["torque"]]
    above = re.sub(r";(scale|factor).*", "", CHANNEL_LIST) + "#;CH1;CH2;CH3;CH4\n"
    rows = (";".join([str(index), *(f"{one[index]:.6g}" for one in columns)]) for index in range(AXIS["t"].size))
    source = tmp_path / "trace.csv"
    source.write_text(above + "\n".join(rows) + "\n")
    draft = draft_map(source)
    assert {one.channel: one.entry["unit"] for one in draft.channels} == {
        "motor_position_rad": "mm",
        "position_command_m": "mm",
        "torque_n_m": "N m",
    }


def test_a_blank_may_follow_a_name_with_a_digit() -> None:
    lines = ["; CH1 Motor position [inc]", "; CH2 Output encoder [deg]", "; CH3 Iq actual [A rms]"]
    told = described(lines, ["CH1", "CH2", "CH3"])
    assert told == {"CH1": ("Motor position", "inc"), "CH2": ("Output encoder", "deg"), "CH3": ("Iq actual", "A rms")}
    assert described(["motor position [mm]", "table position [mm]"], ["motor", "table"]) == {}
