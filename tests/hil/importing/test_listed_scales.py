"""Factors and offsets in lines above the numbers, a line for each channel."""

from __future__ import annotations

from pathlib import Path

import pytest
from foreign_axis import axis

from hil.importing.draft_map import draft_map
from hil.importing.listed_scales import listed_scales
from hil.importing.unit_lines import described

AXIS = axis()
CHANNELS = """SamplePeriod;1 ms
CH1;Pos.feedback;mm;x0.001
CH2;Pos.command;mm;x0.001
CH3;Torque;Nm
#;CH1;CH2;CH3
"""


@pytest.mark.parametrize(
    ("line", "factor", "offset"),
    [
        ("CH1;Position;mm;scale 0.001", 1e-3, 0.0),
        ("CH1;Position;mm;scale .001", 1e-3, 0.0),
        ("CH1;Position;mm;factor=-0.01", -0.01, 0.0),
        ("CH1;Position;mm;Scale: 1e-3", 1e-3, 0.0),
        ("CH1;Position;mm;Faktor 1/1000", 1e-3, 0.0),
        ("CH1;Position;mm;x0.001", 1e-3, 0.0),
        ("CH1;Position;mm;x 0,5", 0.5, 0.0),
        ("CH1,Position,mm,scale 0,001", 1e-3, 0.0),
        ("CH1,Position,LSB=0.01 mm", 0.01, 0.0),
        ("CH1: Position actual, mm; lsb 10", 10.0, 0.0),
        ("CH1|Position|mm|scale 0.5|offset -3", 0.5, -3.0),
        ("CH1;Position [mm];scale 0.001", 1e-3, 0.0),
    ],
)
def test_a_field_tells_the_factor_or_the_offset(line: str, factor: float, offset: float) -> None:
    lines = [line, "CH2;Torque;Nm"]
    assert described(lines, ["CH1", "CH2"])["CH1"] == ("Position" + " actual" * ("actual" in line), "mm")
    listed = listed_scales(lines, ["CH1", "CH2"])
    assert listed.scales == {"CH1": (pytest.approx(factor), offset)}
    assert listed.notes == []


@pytest.mark.parametrize("field", ["scale 0", "scale 5 of 7 mm/V", "0.001", "1e-3", "offset 2..3"])
def test_a_field_that_is_not_read_is_told(field: str) -> None:
    listed = listed_scales([f"CH1;Position;mm;{field}", "CH2;Torque;Nm"], ["CH1", "CH2"])
    assert listed.scales == {}
    assert len(listed.notes) == 1
    assert repr(field) in listed.notes[0]


@pytest.mark.parametrize("field", ["12 bit", "16", "Gain", "drive 1", "0x6064", ""])
def test_other_fields_are_no_factor(field: str) -> None:
    listed = listed_scales([f"CH1;Position;mm;{field}", "CH2;Torque;Nm"], ["CH1", "CH2"])
    assert (listed.scales, listed.notes) == ({}, [])


@pytest.mark.parametrize(
    "line", ["CH1: Position actual, mm; 12 bit", "CH1: Position actual, mm | drive 1", "CH1: Position actual, mm;"]
)
def test_another_separator_behind_the_unit_hides_it_not(line: str) -> None:
    assert described([line, "CH2: Torque, Nm;"], ["CH1", "CH2"]) == {
        "CH1": ("Position actual", "mm"),
        "CH2": ("Torque", "Nm"),
    }


def trace(path: Path, above: str, count_mm: float, digits: int = 0) -> Path:
    """Recording of positions in counts of `count_mm`, with the `digits` behind the point that the file has."""
    columns = [AXIS["x_act"] / count_mm, AXIS["x_set"] / count_mm]
    rows = (
        f"{index};{columns[0][index]:.{digits}f};{columns[1][index]:.{digits}f};{torque:.6g}\n"
        for index, torque in enumerate(AXIS["torque"])
    )
    path.write_text(above + "".join(rows))
    return path


@pytest.mark.parametrize("units", ["", "[-];[mm];[mm];[Nm]\n"])
def test_a_row_of_units_leaves_the_factor_of_the_list(tmp_path: Path, units: str) -> None:
    above = CHANNELS.replace("x0.001", "scale 1e-3")
    draft = draft_map(trace(tmp_path / "trace.csv", above + units, 1e-3))
    entry = next(one.entry for one in draft.channels if one.channel == "motor_position_rad")
    assert (entry["column"], entry["unit"], entry["scale"]) == ("CH1", "mm", pytest.approx(1e-3))


def test_a_factor_that_the_values_hold_is_not_taken_again(tmp_path: Path) -> None:
    draft = draft_map(trace(tmp_path / "trace.csv", CHANNELS, 1.0, digits=4))
    entry = next(one.entry for one in draft.channels if one.channel == "motor_position_rad")
    assert "scale" not in entry
    assert any("hold the factor 0.001 of the header already" in note for note in draft.unsure)


def test_names_of_groups_above_the_names_take_no_row_of_names(tmp_path: Path) -> None:
    rows = (
        f"{AXIS['t'][index]:.4f};{1e3 * AXIS['x_set'][index]:.5f};{1e3 * AXIS['x_act'][index]:.5f};"
        f"{AXIS['speed'][index]:.5f};{AXIS['torque'][index]:.5f}\n"
        for index in range(AXIS["t"].size)
    )
    path = tmp_path / "groups.csv"
    path.write_text("Time;X;X;Drive;Drive\nX;pos_set mm;pos_act mm;speed rad/s;torque Nm\n" + "".join(rows))
    columns = {one.channel: str(one.entry["column"]) for one in draft_map(path).channels}
    assert columns["position_command_m"].startswith("pos_set")
    assert columns["torque_n_m"].startswith("torque")
