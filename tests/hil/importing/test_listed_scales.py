"""Factors and offsets in lines above the numbers, a line for each channel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import LEAD_M, axis
from scipy.io import savemat

from hil.importing.draft_map import draft_map
from hil.importing.listed_scales import listed_scales, value_and_unit
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


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("=360/65536 deg", (360.0 / 65536.0, "deg")),
        ("2^-20 rev", (2.0**-20, "rev")),
        ("1e-4 mm", (1e-4, "mm")),
        ("0,1 1/min", (0.1, "1/min")),
        ("200 mm/V", (200.0, "mm/V")),
        ("0.5 um/LSB", (0.5, "um")),
        ("0,001 x Mn", None),
        ("0x6064", None),
        ("2..3", None),
        ("1e300^64", (0.0, "")),
        ("1e999 mm", None),
        ("", None),
    ],
)
def test_a_number_before_a_unit_may_be_a_fraction_or_a_power(text: str, told: tuple[float, str] | None) -> None:
    found = value_and_unit(text)
    assert found == (None if told is None else (pytest.approx(told[0], rel=1e-12), told[1]))


def drafted(path: Path, above: str, row: str, **columns: np.ndarray) -> dict[str, dict[str, object]]:
    """Entries of the map of a file with lines `above` rows that are formatted by `row`, by channel."""
    rows = (row.format(*values) for values in zip(*columns.values(), strict=True))
    path.write_text(above + "\n".join(rows) + "\n")
    return {one.channel: one.entry for one in draft_map(path).channels}


INDEX = np.arange(AXIS["t"].size)


def test_a_row_of_resolutions_is_no_row_of_names(tmp_path: Path) -> None:
    above = "index,MOTENC,TQ,CMD\nLSB=1,LSB=2^-20 rev,LSB=0.01 Nm,LSB=1e-4 mm\n# fs=1000 Hz\n"
    turns, torque, command = AXIS["angle"] / (2.0 * np.pi) * 2**20, AXIS["torque"] / 0.01, AXIS["x_set"] / 1e-4
    found = drafted(tmp_path / "a.csv", above, "{},{:.0f},{:.0f},{:.0f}", i=INDEX, a=turns, b=torque, c=command)
    motor, effort = found["motor_position_rad"], found["torque_n_m"]
    assert (motor["column"], motor["unit"], motor["scale"]) == ("MOTENC", "rev", pytest.approx(2.0**-20))
    assert (effort["column"], effort["unit"], effort["scale"]) == ("TQ", "N m", pytest.approx(0.01))


def test_an_italian_row_of_scales_and_hundredths_of_a_unit_are_read(tmp_path: Path) -> None:
    above = "Campione;PosEff;CoppiaEff;PosTeor\n[n];[mm/100];[Nm];[mm/100]\n"
    above += 'scala 1;scala 1;scala 0,01;scala 1\n"Periodo";"1,0 ms"\n'
    found = drafted(
        tmp_path / "a.csv",
        above,
        "{};{:.0f};{:.0f};{:.0f}",
        i=INDEX,
        a=AXIS["x_act"] / 0.01,
        b=AXIS["torque"] / 0.01,
        c=AXIS["x_set"] / 0.01,
    )
    motor = found["motor_position_rad"]
    assert (motor["column"], motor["unit"], motor["scale"]) == ("PosEff", "mm", pytest.approx(0.01))
    assert found["position_command_m"]["column"] == "PosTeor"
    assert found["torque_n_m"]["scale"] == pytest.approx(0.01)


def test_a_scale_per_volt_turns_the_volts_of_a_scope_into_its_unit(tmp_path: Path) -> None:
    above = "Label,POS,SPD,TRQ\nVertical Units,V,V,V\nScale,200 mm/V,400 rpm/V,2 Nm/V\n\nTIME,CH1,CH2,CH3\n"
    found = drafted(
        tmp_path / "a.csv", above, "{:.4f},{:.6f},{:.5f},{:.5f}",
        t=AXIS["t"], a=AXIS["x_act"] / 200.0, b=AXIS["speed"] * 30.0 / np.pi / 400.0, c=AXIS["torque"] / 2.0,
    )  # fmt: skip
    motor, effort = found["motor_position_rad"], found["torque_n_m"]
    assert (motor["column"], motor["unit"], motor["scale"]) == ("POS", "mm", pytest.approx(200.0))
    assert (effort["column"], effort["unit"], effort["scale"]) == ("TRQ", "N m", pytest.approx(2.0))


def test_a_list_of_channels_by_number_tells_names_and_factors_beside_the_number_of_the_row(tmp_path: Path) -> None:
    above = "Abtastzeit   1,0 ms\nKanal 1   Lageistwert   Faktor 1e-3 mm\nKanal 2   Momentenistwert   Faktor 0,01 Nm\n"
    found = drafted(
        tmp_path / "a.trc", above, "{:7d}{:10.0f}{:10.0f}", i=INDEX, a=AXIS["x_act"] / 1e-3, b=AXIS["torque"] / 0.01
    )
    motor, effort = found["motor_position_rad"], found["torque_n_m"]
    assert (motor["column"], motor["unit"], motor["scale"]) == ("Lageistwert", "mm", pytest.approx(1e-3))
    assert (effort["column"], effort["unit"], effort["scale"]) == ("Momentenistwert", "N m", pytest.approx(0.01))


def test_a_unit_row_that_begins_with_an_empty_field_is_no_list_without_the_time(tmp_path: Path) -> None:
    """The number of the row got the unit of the time, and was taken for the clock: half the time, twice the lead."""
    above = "Zyklus;2 ms\n\nNr.;Zeit;SollPos;IstPos;Moment\n;ms;mm;mm;Nm\n"
    path = tmp_path / "a.csv"
    rows = zip(1 + INDEX, 2.0 * INDEX, AXIS["x_set"], AXIS["x_act"], AXIS["torque"], strict=True)
    path.write_text(above + "".join("{};{:.1f};{:.5f};{:.4f};{:.4f}\n".format(*row) for row in rows))
    assert draft_map(path).clock.time_s[-1] == pytest.approx(2e-3 * INDEX[-1])


def test_rows_of_another_kind_by_their_first_field_are_no_rows_of_numbers(tmp_path: Path) -> None:
    above = "dump;axis J1\nname,TICK,ENC_MOT,TRQ\nLSB,=1e-3 s,=360/131072 deg,=0.01 Nm\nzero,0,2211,0\n"
    counts = 2211 + AXIS["angle"] / (2.0 * np.pi) * 131072
    found = drafted(tmp_path / "a.csv", above, "data,{},{:.0f},{:.0f}", i=INDEX, a=counts, b=AXIS["torque"] / 0.01)
    motor, effort = found["motor_position_rad"], found["torque_n_m"]
    assert (motor["column"], motor["unit"], motor["scale"]) == ("ENC_MOT", "deg", pytest.approx(360.0 / 131072.0))
    assert (effort["column"], effort["unit"]) == ("TRQ", "N m")
    assert draft_map(tmp_path / "a.csv").clock.time_s.size == INDEX.size


def test_cells_of_a_mat_file_tell_unit_and_resolution_of_its_vectors(tmp_path: Path) -> None:
    cells = np.array([["x_act", "0.1 um/LSB"], ["iq", "2e-3 N/LSB (peak)"]], dtype=object)
    values = {
        "x_act": np.round(1e4 * AXIS["x_act"]).astype(np.int32),
        "iq": np.round(AXIS["torque"] / 2e-3).astype(np.int16),
    }
    savemat(tmp_path / "a.mat", {"t": AXIS["t"], **values, "chinfo": cells})
    found = {one.channel: one.entry for one in draft_map(tmp_path / "a.mat").channels}
    motor, effort = found["motor_position_m"], found["force_n"]
    assert (motor["unit"], motor["scale"]) == ("um", pytest.approx(0.1))
    assert (effort["unit"], effort["scale"]) == ("N", pytest.approx(2e-3))


def test_a_second_encoder_in_counts_has_their_size_by_the_set_point_that_it_follows(tmp_path: Path) -> None:
    """Behind a gear: 8192 counts per turn of the motor, 3600 per degree of the table, a ratio of 90."""
    above = "MOT = codeur moteur (8192 pt/tr)\nT\tPLAT\tMOT\tC\tCONS\n[s]\t[pt]\t[pt]\t[N.m]\t[deg]\n"
    turns = AXIS["angle"] / (2.0 * np.pi)
    late = np.interp(AXIS["t"] + 0.004, AXIS["t"], turns, right=turns[-1])
    found = drafted(
        tmp_path / "a.txt", above, "{:.4f}\t{:.0f}\t{:.0f}\t{:.4f}\t{:.6f}",
        t=AXIS["t"], a=turns / 90.0 * 1296000.0, b=turns * 8192.0, c=AXIS["torque"], d=360.0 * late / 90.0,
    )  # fmt: skip
    table = found["table_position_m"]
    assert (table["column"], table["unit"]) == ("PLAT", "deg")
    assert table["scale"] == pytest.approx(1.0 / 3600.0, rel=2e-3)


def test_a_list_of_channels_may_have_unit_and_factor_behind_semicolons(tmp_path: Path) -> None:
    above = "Ts=1ms\n[CHANNELS]\nCh1=POS_REF; mm; scale 0,001\nCh2=POS_ACT; mm; scale 0,001\n"
    above += "Ch3=N_ACT; LSB=0.01 rpm\nCh4=M_ACT; Nm; scale 0.01\n[DATA]\n"
    found = drafted(
        tmp_path / "a.trc", above, "{:.0f} {:.0f} {:.0f} {:.0f}",
        a=AXIS["x_set"] / 1e-3, b=AXIS["x_act"] / 1e-3, c=AXIS["speed"] * 3000.0 / np.pi, d=AXIS["torque"] / 0.01,
    )  # fmt: skip
    motor, effort = found["motor_position_rad"], found["torque_n_m"]
    assert (motor["column"], motor["unit"], motor["scale"]) == ("POS_ACT", "mm", pytest.approx(1e-3))
    assert (effort["column"], effort["unit"], effort["scale"]) == ("M_ACT", "N m", pytest.approx(0.01))
    assert draft_map(tmp_path / "a.trc").lead_m == pytest.approx(LEAD_M, rel=1e-3)
