"""A speed set-point is told: the velocity of the position set-point, or the output of the position loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_axis import LEAD_M, axis, csv_text, renamed, write

from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft

AXIS = axis()
NAMES = {"t": "time_s", "x_set": "position_setpoint_mm", "angle": "motor_angle_rad", "torque": "torque_Nm"}


def channels(draft: MapDraft) -> dict[str, Any]:
    return {one.channel: one.entry for one in draft.channels}


@pytest.mark.parametrize("feedforward", [1.0, 0.0])
def test_a_speed_set_point_with_the_following_error_is_the_output_of_the_position_loop(
    tmp_path: Path, feedforward: float
) -> None:
    gain_1_s = 40.0
    error_rad = AXIS["torque"] / 20.0 + (1.0 - feedforward) * AXIS["speed"] / gain_1_s
    angle_set = AXIS["angle"] + error_rad
    speed = feedforward * np.gradient(angle_set, AXIS["t"]) + gain_1_s * error_rad
    set_points = {"x_set": 1e3 * LEAD_M / (2.0 * np.pi) * angle_set, "n_set": speed}
    columns = renamed(AXIS | set_points, **NAMES, n_set="speed_setpoint_rad_s")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert channels(draft)["velocity_reference_m_s"]["column"] == "speed_setpoint_rad_s"
    assert "velocity_command_m_s" not in channels(draft)


def test_a_speed_set_point_without_it_is_the_velocity_of_the_set_point(tmp_path: Path) -> None:
    speed = np.gradient(AXIS["x_set"], AXIS["t"])
    columns = renamed(AXIS | {"v_set": speed}, **NAMES, v_set="velocity_setpoint_mm_s")
    assert channels(draft_map(write(tmp_path / "log.csv", columns)))["velocity_command_m_s"]


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "mm/s"), (0.06, "m/min")])
@pytest.mark.parametrize("name", ["v_set", "speed_command_raw"])
def test_the_unit_of_a_speed_follows_from_the_set_point(tmp_path: Path, factor: float, unit: str, name: str) -> None:
    columns = renamed(AXIS | {"v": factor * np.gradient(AXIS["x_set"], AXIS["t"])}, **NAMES, v=name)
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert channels(draft)["velocity_command_m_s"]["unit"] == unit
    assert name not in draft.left_out


@pytest.mark.parametrize("factor", [1.175, 900.0])
@pytest.mark.parametrize("name", ["v_set", "speed_command_raw"])
def test_a_speed_whose_scale_is_no_unit_gets_that_to_the_set_point(tmp_path: Path, factor: float, name: str) -> None:
    columns = renamed(AXIS | {"v": factor * np.gradient(AXIS["x_set"], AXIS["t"])}, **NAMES, v=name)
    draft = draft_map(write(tmp_path / "log.csv", columns))
    entry = channels(draft)["velocity_command_m_s"]
    assert entry["unit"] == "m/s"
    assert entry["scale"] == pytest.approx(1e-3 / factor, rel=2e-3)
    assert any("is its scale to the derivative of" in note for note in draft.unsure)


def test_a_speed_that_contradicts_its_own_unit_is_left_out(tmp_path: Path) -> None:
    columns = renamed(AXIS | {"v": 3.0 * np.gradient(AXIS["x_set"], AXIS["t"])}, **NAMES, v="v_set_mm_s")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert draft.left_out["v_set_mm_s"].startswith("in mm/s no velocity: 3")


DEG, RPM = 180.0 / np.pi, 30.0 / np.pi


@pytest.mark.parametrize(
    ("scale", "speed", "name", "unit"),
    [
        (1.0, 1.0, "OMEGA", "rad"),
        (1.0, RPM, "n_ist", "rad"),
        (DEG, 1.0, "OMEGA", "deg"),
        (DEG, RPM, "n_ist", "deg"),
        (1.0, 1.0, "speed", "rad"),  # its steps are whole counts per turn
        (DEG, DEG, "speed", "deg"),
    ],
)
def test_the_unit_of_an_angle_follows_from_its_speed_or_its_counts(
    tmp_path: Path, scale: float, speed: float, name: str, unit: str
) -> None:
    count = 2.0 * np.pi / 20000
    angle = np.round(AXIS["angle"] / count) * count
    changed = {"angle": scale * angle, "x_set": scale * AXIS["x_set"] * 0.2 * np.pi, "speed": speed * AXIS["speed"]}
    columns = renamed(AXIS | changed, t="t_s", x_set="PHI_REF", angle="PHI", speed=name, torque="I_Q")
    found = channels(draft_map(write(tmp_path / "log.csv", columns)))
    assert (found["motor_position_rad"]["unit"], found["position_command_m"]["unit"]) == (unit, unit)


def test_where_nothing_tells_the_unit_of_an_angle_it_is_asked(tmp_path: Path) -> None:
    columns = renamed(AXIS | {"angle": np.round(AXIS["angle"], 3)}, t="time_s", angle="phi", torque="i_A")
    asked = {(one.channel, one.key) for one in draft_map(write(tmp_path / "log.csv", columns)).asked}
    assert asked == {("motor_position_rad", "unit"), ("torque_n_m", "torque_constant_n_m_a")}


def test_a_gear_of_whole_numbers_is_no_lead(tmp_path: Path) -> None:
    columns = renamed(AXIS | {"x_act": 0.01 * AXIS["angle"]}, t="time_s", x_act="q_link", angle="q_mot", torque="tau")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {one.entry["unit"] for one in draft.channels[:2]} == {"rad"}
    assert any("moves 0.01 times as far" in note for note in draft.unsure)


def test_counts_of_a_second_encoder_have_the_size_of_a_linear_scale(tmp_path: Path) -> None:
    scale = {"x_act": np.round(1.004e3 * AXIS["x_act"]), "angle": np.round(AXIS["angle"] * 8192 / (2.0 * np.pi))}
    names = {"x_act": "lin_enc[cnt]", "angle": "mot_enc[cnt]", "torque": "torque[Nm]"}
    draft = draft_map(write(tmp_path / "log.csv", renamed(AXIS | scale, t="t[s]", x_set="set[mm]", **names)))
    assert channels(draft)["table_position_m"]["counts_per_m"] == 1e6


def test_the_lead_of_the_header_sizes_the_counts_of_a_second_encoder(tmp_path: Path) -> None:
    turns = {"t": AXIS["t"], "turns": AXIS["angle"] / (2.0 * np.pi), "torque": AXIS["torque"]}
    turns["scale"] = np.round(AXIS["x_act"] / 5e-3) + 31_000.0
    columns = renamed(turns, t="time_s", turns="motor_pos_rev", scale="scale_cnt", torque="torque_Nm")
    path = tmp_path / "log.csv"
    path.write_text(csv_text(columns, ";", above="passo vite 10 mm/giro\n"))
    draft = draft_map(path)
    assert draft.lead_m == pytest.approx(LEAD_M)
    assert channels(draft)["table_position_m"]["counts_per_m"] == pytest.approx(200_000.0)


@pytest.mark.parametrize(("name", "factor"), [("pos_m", 20.0), ("pos_nm", 1e-3), ("angle_rev", 400.0)])
def test_a_travel_that_no_machine_has_is_asked(tmp_path: Path, name: str, factor: float) -> None:
    columns = renamed(AXIS | {"x_act": factor * AXIS["x_act"]}, t="time_s", x_act=name, torque="torque_A")
    assert any("is its unit" in note for note in draft_map(write(tmp_path / "log.csv", columns)).unsure)


def test_a_set_point_in_counts_of_unknown_size_is_asked_with_those_of_the_encoder(tmp_path: Path) -> None:
    """A size that is taken until the user tells it would leave the set-point another size."""
    counts = {"angle": np.round(AXIS["angle"] * 40000 / (2 * np.pi))}
    counts["x_set"] = np.round(AXIS["x_set"] / LEAD_M * 40000)
    names = {"t": "time_s", "x_set": "Cmd Pos", "angle": "Act Pos", "torque": "torque_Nm"}
    draft = draft_map(write(tmp_path / "log.csv", renamed(AXIS | counts, **names)))
    asked = [(one.channel, one.key) for one in draft.asked]
    assert asked == [(name, "counts_per_rev") for name in ("motor_position_rad", "position_command_m")]
    assert channels(draft)["position_command_m"]["unit"] == "counts"
