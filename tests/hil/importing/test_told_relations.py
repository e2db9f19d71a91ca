"""Two encoders are no set-point and its motion; ratios that columns tell; steppers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, csv_text

from hil.drafting.first_look import first_look
from hil.errors import PartOfAxis
from hil.importing.by_map import import_recording
from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.encoder_counts import counts_ratio
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text
from hil.importing.own_units import take_own_units

AXIS = axis(4000)
T, TORQUE, RPM = AXIS["t"], AXIS["torque"], AXIS["speed"] * 30 / np.pi
NOISE = np.random.default_rng(5).normal(0.0, 1.0, (2, T.size))


def drafted(path: Path, columns: dict[str, np.ndarray]) -> MapDraft:
    path.write_text(csv_text({"t_s": T} | columns))
    return draft_map(path)


def column_of(draft: MapDraft, channel: str) -> object:
    return next(one.entry["column"] for one in draft.channels if one.channel == channel)


@pytest.mark.parametrize(
    ("motor", "load"),
    [("enc1_mm", "enc2_mm"), ("Geber 2 [mm]", "Geber 1 [mm]"), ("x2_mm", "x1_mm"), ("codeur2_mm", "codeur1_mm")],
)
def test_two_encoders_are_no_set_point_with_less_noise(tmp_path: Path, motor: str, load: str) -> None:
    fine = AXIS["x_act"] + 1e-5 * NOISE[0]
    soft = np.interp(T - 0.006, T, AXIS["x_act"]) + 3e-3 * NOISE[1]
    draft = drafted(tmp_path / "log.csv", {load: soft, motor: fine, "n_rpm": RPM, "M_Nm": TORQUE})
    assert column_of(draft, "motor_position_rad") == motor
    assert column_of(draft, "table_position_m") == load
    assert any("exchange them if not" in note for note in draft.unsure)


def test_the_first_encoder_is_the_motors_where_nothing_tells(tmp_path: Path) -> None:
    one, other = (AXIS["x_act"] + 1e-4 * noise for noise in NOISE)
    draft = drafted(tmp_path / "log.csv", {"enc2_mm": one, "enc1_mm": other, "M_Nm": TORQUE})
    assert column_of(draft, "motor_position_rad") == "enc1_mm"


@pytest.mark.parametrize("gear", [37.0, 2.5])
def test_a_speed_of_the_motor_tells_the_gear_to_an_angle_of_the_load(tmp_path: Path, gear: float) -> None:
    table = np.rad2deg(AXIS["angle"]) / gear
    draft = drafted(tmp_path / "log.csv", {"phi_Tisch_Grad": table, "n_Mot_Upm": RPM, "M_Nm": TORQUE})
    (entry,) = (one.entry for one in draft.channels if one.channel == "motor_position_rad")
    assert entry["scale"] == pytest.approx(gear, rel=2e-3)
    assert any("from column n_Mot_Upm" in note for note in draft.unsure)


def test_a_speed_of_the_same_shaft_is_no_gear(tmp_path: Path) -> None:
    draft = drafted(tmp_path / "log.csv", {"phi_Grad": np.rad2deg(AXIS["angle"]), "n_Upm": RPM, "M_Nm": TORQUE})
    assert "scale" not in draft.channels[0].entry


def test_a_speed_in_turns_beside_a_length_tells_a_screw_of_a_current(tmp_path: Path) -> None:
    columns = {"hub [um]": 1e3 * AXIS["x_act"], "n [deg/s]": 6.0 * RPM, "Iq [A]": TORQUE}
    draft = drafted(tmp_path / "log.csv", columns)
    assert draft.lead_m == 0.010
    assert "n [deg/s]" in draft.lead_how
    assert {one.key for one in draft.asked} == {"torque_constant_n_m_a"}


STEPS = np.round(AXIS["angle"] / (2 * np.pi) * 6400)


@pytest.mark.parametrize(("command", "encoder"), [("CMD", "ENC"), ("Schritte", "Geber"), ("steps", "enc_steps")])
def test_steps_that_an_encoder_follows_are_the_motion(tmp_path: Path, command: str, encoder: str) -> None:
    counts = np.round(AXIS["angle"] / (2 * np.pi) * 2400) + 512
    draft = drafted(tmp_path / "log.csv", {command: STEPS, encoder: counts})
    assert column_of(draft, "motor_position_rad") == command
    assert column_of(draft, "table_position_m") == encoder
    asked = [(one.channel, one.key) for one in draft.asked]
    assert asked == [("motor_position_rad", "counts_per_rev"), ("table_position_m", "counts_per_rev")]
    told = f"those per revolution of the load; on the motor's shaft 0.375 times that of {command}"
    assert told in draft.asked[1].what
    take_own_units(draft)
    motor, table = (float(str(one.entry["counts_per_rev"])) for one in draft.channels)
    assert table / motor == pytest.approx(0.375)


@pytest.mark.parametrize("unit", ["[1/16 step]", "(usteps)", "Schritte"])
def test_a_unit_of_steps_says_that_the_set_points_count_them(tmp_path: Path, unit: str) -> None:
    counts = np.round(AXIS["angle"] / (2 * np.pi) * 4000)
    columns = {"t": T, "cmd": STEPS, "enc_motor": counts, "scale": np.round(5e3 * AXIS["angle"] / (2 * np.pi))}
    source = tmp_path / "log.txt"
    names, *rows = csv_text(columns).splitlines()
    source.write_text("\n".join([names, f"[s],{unit},[counts],[um]", *rows]) + "\n")
    draft = draft_map(source)
    assert column_of(draft, "motor_position_rad") == "enc_motor"
    command = next(one for one in draft.channels if one.channel == "position_command_m")
    assert draft.lead_m is not None
    turns = np.ptp(STEPS) / 6400.0
    per_count = float(str(command.entry["scale"])) * draft.lead_m / (2.0 * np.pi)  # rad of the motor as travel
    assert np.ptp(STEPS) * per_count == pytest.approx(5e-3 * turns, rel=1e-3)
    assert draft.asked == []


@pytest.mark.parametrize("unit", ["[1/16 step]", "[µsteps]", "(half step)", "[Schritt]", "[pas]", "[passi]"])
def test_units_of_steps_are_known(unit: str) -> None:
    assert label(f"cmd {unit}").steps
    assert label("cmd", unit).steps
    assert not label(f"pos_act {unit}").steps  # measured


@pytest.mark.parametrize(
    "name", ["Step [#]", "Torque step [arb]", "resolution [deg/step]", "cmd [steps/s]", "step [x]"]
)
def test_other_units_beside_a_step_are_no_steps(name: str) -> None:
    assert not label(name).steps


def test_steps_beside_a_linear_scale_tell_all_but_the_lead(tmp_path: Path) -> None:
    """Delay, lost motion and scale of an axis without a torque; the travel per turn is taken, and can be corrected."""
    source, late = tmp_path / "log.csv", 0.004
    angle = np.interp(T - late, T, AXIS["angle"])
    scale = np.round(1e4 * angle / (2 * np.pi) * 5.0) / 1e4
    source.write_text(csv_text({"t_s": T, "Sollschritte": STEPS, "Massstab [mm]": scale}))
    draft = draft_map(source)
    take_own_units(draft)
    assert any("lead_m: its numbers count as turns of 10 mm" in note for note in draft.unsure)
    path = tmp_path / "map.yaml"
    path.write_text(re.sub(r"^lead_m:.*", "lead_m: 0.005", map_text(draft), flags=re.MULTILINE))
    look = first_look([import_recording(source, path)])
    assert look[1].startswith("No torque is recorded")
    found = re.search(r"0\.0050\d* m .* per revolution of the motor.*, ([\d.]+) ms late", look[2])
    assert found, look
    assert float(found[1]) == pytest.approx(1e3 * late, abs=0.2)


def test_steps_are_known_by_name_though_uneven_stamps_make_them_no_whole_numbers(tmp_path: Path) -> None:
    """Channels are interpolated to a regular clock before their relations are told."""
    uneven = T + np.random.default_rng(1).uniform(-3e-4, 3e-4, T.size)
    angle = np.interp(uneven, T, AXIS["angle"])
    steps, counts = (np.round(angle / (2 * np.pi) * per_rev) for per_rev in (3200, 5000))
    columns = {"t_s": uneven, "cmd_usteps": steps, "scale_cnt": counts, "drv_temp": np.round(38 + np.sin(T), 1)}
    draft = drafted(tmp_path / "log.csv", columns)
    assert column_of(draft, "motor_position_rad") == "cmd_usteps"
    assert column_of(draft, "table_position_m") == "scale_cnt"
    assert "of a linear scale" in draft.asked[1].what


@pytest.mark.parametrize(("ratio", "snaps"), [(1.25, True), (64 / 101, False), (1.0 / 3.0, True)])
def test_counts_of_two_encoders_are_a_fraction_only_where_they_agree(ratio: float, snaps: bool) -> None:
    """19/30 is 64/101 but for 0.05 %, which a diagnosis would name an error of the transmission."""
    measured = ratio * (1.0 + 3e-6)
    assert counts_ratio(measured) == (ratio if snaps else measured)


def test_a_set_point_in_the_counts_of_the_encoder_is_none_of_a_stepper(tmp_path: Path) -> None:
    counts = np.roll(STEPS, 3)
    with pytest.raises(PartOfAxis, match=r"no torque.*another file of the same run"):
        drafted(tmp_path / "log.csv", {"CMD": STEPS, "ENC": counts})
