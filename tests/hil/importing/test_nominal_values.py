"""Sentences of an owner tell the mass of the load and the inertia of the motor; others tell neither."""

from __future__ import annotations

from pathlib import Path

import pytest
from foreign_axis import axis, renamed, write

from hil.commands.import_ import import_
from hil.importing.header_values import header_values
from hil.importing.lexicon import Constant
from hil.importing.map_file import RecordingMap
from hil.recording.recording import read_recording

LOAD, TURNING, MOTOR = Constant.LOAD_MASS, Constant.LOAD_INERTIA, Constant.MOTOR_INERTIA
SPRING, TORSION = Constant.STIFFNESS, Constant.TORSION


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("Table with fixture about 335 kg.", {LOAD: 335.0}),
        ("Slide with dressing spindle: 44 kg. Motor + coupling + screw: 1.62e-4 kgm2.", {LOAD: 44.0, MOTOR: 1.62e-4}),
        ("Schlitten ca. 120 kg, Motor mit Kupplung 2,1 kgcm²", {LOAD: 120.0, MOTOR: 2.1e-4}),
        ("Masse des Tisches: 85 kg", {LOAD: 85.0}),
        ("Rotor + wave generator 6e-5 kg m2, arm with payload about 1.68 kg m2", {MOTOR: 6e-5, TURNING: 1.68}),
        ("Payload + platform 0.93 kgm2; motor with first stage 4.2e-5 kg m^2", {TURNING: 0.93, MOTOR: 4.2e-5}),
        ("Moved mass: about 37 kg (carriage with vacuum frame)", {LOAD: 37.0}),
        ("La table pese 80 kg", {LOAD: 80.0}),
        ("The table weighs 45 lb, with its vise.", {LOAD: 20.41165665}),
        ("Moving mass 12 kilograms", {LOAD: 12.0}),
        ("axial stiffness screw + nut + bearings, by the maker: 140 N/um", {SPRING: 140e6}),
        ("- gear data sheet: torsional stiffness at the output 1.6e6 Nm/rad, no backlash", {TORSION: 1.6e6}),
        ("Gesamtsteifigkeit 56 N/um", {SPRING: 56e6}),
        ("Drehsteifigkeit 19 Nm/arcmin", {TORSION: 19.0 * 3437.746770784939}),
    ],
)
def test_the_word_nearest_to_the_number_tells_whose_it_is(line: str, told: dict[Constant, float]) -> None:
    found = header_values([line], {})
    assert {constant: one.value for constant, one in found.items()} == pytest.approx(told)


@pytest.mark.parametrize(
    "line",
    [
        "Motor, screw and table together 0.01 kg m2",
        "the motor weighs 3 kg",
        "table: 12 kg m of imbalance",
        "max load 500 kg",
        "table torque 45 lb in",
        "table 45 lb plus fixture",
        "Rated load 200 kg",
        "counterweight of the table 262 kg",
        "total inertia at the motor including the head 1.05e-3 kg m2",
        "about 550 kg",
        "Permissible table load 300 kg",
        "Zul. Tischlast 300 kg",
        "The table carries workpieces of 200 kg",
        "Table 300 kg plus fixture 35 kg",
        "Bridge and carriage 120 kg + 40 kg",
        "Table acceleration 0.5 g",
        "Slide friction 3 kg",
        "Load cell 50 kg",
        "The machine with table weighs 4500 kg",
        "last recording with 20 kg",
        "Table mass unknown; motor 12 kg",
        "The motor sits on the table. It weighs 12 kg",
        "without load 300 kg",
        "Motor + load 0.01 kgm2",
        "Load inertia at the motor shaft 1e-4 kgm2",
        "Brake 0.2 kgcm2",
        "Table mass 1,200 kg",
        "Tischmasse 1.200,5 kg",
        "table 0 kg",
        "coupling stiffness 4000 Nm/rad",
        "bellows: stiffness 2 N/mm, contact at 6.8 mm",
        "stiffness of the belt: don't know",
        "Stiffness: 56,000 N/m",
        "min. stiffness 100 N/um",
        "Stiffness of the nut 400 N/um",
        "Cable chain: force 20 N, stiffness 40 N/m",
    ],
)
def test_a_sum_a_limit_and_another_quantity_tell_nothing(line: str) -> None:
    found = {LOAD, TURNING, MOTOR, SPRING, TORSION} & set(header_values([line], {}))
    assert not found


def test_two_masses_of_one_load_tell_none() -> None:
    assert not header_values(["table 80 kg", "table with vice 95 kg"], {})


def test_a_map_holds_what_the_owner_tells_and_a_recording_too(tmp_path: Path) -> None:
    source = write(tmp_path / "log.csv", renamed(axis(), t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    (tmp_path / "readme.txt").write_text("Table with fixture about 335 kg, rotor 2e-3 kg m2.\n")
    import_(source, None, tmp_path / "log.parquet", readme=tmp_path / "readme.txt")
    assert "load_mass_kg: 335.0" in (tmp_path / "log-map.yaml").read_text()
    recording = read_recording(tmp_path / "log.parquet")
    assert recording.metadata["nominal"] == {"load_mass_kg": 335.0, "motor_inertia_kg_m2": 2e-3}


def test_a_mass_is_positive() -> None:
    with pytest.raises(ValueError, match="load_mass_kg"):
        RecordingMap.model_validate({"about": "x", "nominal": {"load_mass_kg": 0.0}, "channels": {}})
