"""Names that lines list by the place of a column, and units within names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis

from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.lexicon import Quantity
from hil.importing.listed_names import listed_names
from hil.importing.units import factor_and_unit, unit_named

AXIS = axis(2000)

LISTS = {
    "channel = name": (["channel 1 = s_um", "channel 2 = v_mm_per_s", "channel 3 = M_Nm", "rate: 1 kHz", "END"], " "),
    "Spalte: Name": (["Spalte 1: s_um", "Spalte 2: v_mm_s", "Spalte 3: M_Nm", "Abtastzeit 1 ms"], ";"),
    "one line": (["; log of the drive, period 1.0 ms", "; #1 s [um] ; #2 v [mm/s] ; #3 M [Nm]"], ";"),
    "from 0": (["# dt = 1 ms", "# voie 0 s_um, voie 1 v_mm_s, voie 2 M_Nm"], "\t"),
    "word before names": (["% dt 1 ms", "% colonne: s_um v_mm_s M_Nm"], " "),
}


@pytest.mark.parametrize("kind", LISTS)
def test_names_of_a_list_are_those_of_the_columns(tmp_path: Path, kind: str) -> None:
    lines, delimiter = LISTS[kind]
    values = zip(1e3 * AXIS["x_act"], AXIS["speed"] * 10 / (2 * np.pi), AXIS["torque"], strict=True)
    rows = [delimiter.join(f"{one:.4f}" for one in row) for row in values]
    path = tmp_path / "log.asc"
    path.write_text("\n".join([*lines, *rows]) + "\n")
    draft = draft_map(path)
    position, torque = draft.channels
    assert str(position.entry["column"]).startswith("s")
    assert (position.entry["unit"], torque.entry["unit"]) == ("um", "N m")
    assert draft.clock.rate_hz == 1000.0
    assert not any("is not used" in note for note in draft.unsure)


def test_only_a_complete_list_in_turn_is_one() -> None:
    told = listed_names(["Channel1,PosRef,um", "Channel2,IqAct,A"], ",", 2)
    assert told is not None
    assert told.names == ("PosRef", "IqAct")
    told = listed_names(["1: Weg, Motor  mm", "2: Kraft, Stempel  N"], ";", 2)
    assert told is not None
    assert told.names == ("Weg, Motor", "Kraft, Stempel")
    assert listed_names(["ch 1: x", "ch 3: y"], ";", 2) is None
    assert listed_names(["ch 2: y", "ch 1: x"], ";", 2) is None
    assert listed_names(["ch1 pos;ch2 torque"], ";", 2) is None  # a row of names
    found = listed_names(["about 1", "1: x [mm]", "2: F [N]"], ";", 2)
    assert found is not None
    assert found.names == ("x [mm]", "F [N]")


UNITS = {
    "arm_angle_mrad_out": "mrad",
    "drive_vel_rpm_raw2": "rpm",
    "pos mm carriage": "mm",
    "speed_mm_s_slide": "mm/s",
    "couple_mnm_axe": "mN m",
    "geschw_m_per_min": "m/min",
    "joint_vel_dps_b": "deg/s",
    "pos_in_axis": None,  # a word
    "pos_rev_b": None,
    "pos_a_ist": None,  # a letter
    "vel_mm_axis": None,  # of another quantity
    "temp_deg_motor": None,
}


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_is_a_word_within_a_name_of_its_quantity(name: str) -> None:
    assert label(name).unit == UNITS[name]


def test_counts_of_a_length_are_a_factor_and_its_unit() -> None:
    assert factor_and_unit("0.25um cts") == (0.25, "um")
    assert factor_and_unit("0,1 mdeg/count") == (0.1, "mdeg")
    assert factor_and_unit("0.1 mm/s") == (0.1, "mm/s")
    assert factor_and_unit("1/0 rad") is None
    assert unit_named("deg per s") == "deg/s"
    assert unit_named("percent") == "%"


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("6077 torque actual", "permille"),
        ("Torque actual value 0x6077", "permille"),
        ("6074h_torque_demand", "permille"),
        ("6078 current actual value", "permille"),
        ("torque 6077 [Nm]", "N m"),  # what the file says counts more than the standard
        ("torque 16077", None),
        ("6064 position actual", None),
    ],
)
def test_objects_of_the_drive_profile_have_the_unit_of_the_standard(name: str, unit: str | None) -> None:
    assert label(name).unit == unit


@pytest.mark.parametrize("name", ["torque_pct_Mn", "torque_percent_rated", "Moment_Prozent_Mnenn"])
def test_a_percentage_is_the_unit_before_what_it_is_of(name: str) -> None:
    assert label(name).unit == "%"


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("stem_pos_%", Quantity.POSITION),
        ("Drehzahl [%]", Quantity.VELOCITY),
        ("M_soll_%", Quantity.EFFORT),
        ("motor_pct_speed", Quantity.VELOCITY),
        ("torque_setpoint_%", Quantity.EFFORT),
        ("load_%", Quantity.EFFORT),
    ],
)
def test_a_percentage_of_a_motion_is_no_torque(name: str, quantity: Quantity) -> None:
    found = label(name)
    assert found.quantity is quantity
    assert found.unit == ("%" if quantity is Quantity.EFFORT else None)


def test_words_after_a_percentage_keep_their_meaning() -> None:
    assert label("torque_pct_soll").command
    assert label("torque_pct_ist").measured
    assert label("torque_pct_axis2").number == "2"
