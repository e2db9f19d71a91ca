"""Which column is the motion: following errors and speeds among columns that look like positions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, renamed, write

from hil.errors import PartOfAxis
from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.lexicon import Quantity

AXIS = axis()


@pytest.mark.parametrize(
    "name",
    [
        "droop pulses [pulse]", "溜りパルス[pulse]", "位置偏差[pulse]", "滞留脉冲 [inc]", "Schleppfehler [Inkr]",
        "Erreur de trainage [inc]", "scarto di posizione [inc]", "desviacion de posicion [inc]", "volgfout [inc]",
        "рассогласование [inc]", "joint.0.f-error [inc]", "PosErr [inc]", "FOLLERR [inc]", "position lag [inc]",
    ],
)  # fmt: skip
def test_a_following_error_is_no_position_by_its_name(name: str) -> None:
    assert label(name).quantity is Quantity.OTHER


def test_a_following_error_is_no_position_by_its_values(tmp_path: Path) -> None:
    """The velocity over the gain, whatever its name."""
    error = np.round(AXIS["speed"] / 30.0 / 1e-4)
    columns = {"time_s": AXIS["t"], "P1 [inc]": error, "speed [rad/s]": AXIS["speed"],
               "torque_Nm": AXIS["torque"]}  # fmt: skip
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {one.channel: one.entry["column"] for one in draft.channels} == {
        "motor_velocity_rad_s": "speed [rad/s]",
        "torque_n_m": "torque_Nm",
    }
    assert not draft.asked
    assert any("grows with speed [rad/s] itself, as a following error does" in note for note in draft.unsure)


def test_a_counter_of_rows_is_not_asked_as_the_torque(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", {"No": np.arange(AXIS["t"].size), "pos [rad]": AXIS["angle"]})
    with pytest.raises(PartOfAxis, match="no torque, force, current, voltage or second encoder"):
        draft_map(path, rate_hz=1000.0)


def test_a_speed_by_its_letter_is_no_position_where_it_explains_a_column_better(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="t", speed="n", torque="m")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {one.channel: one.entry["column"] for one in draft.channels} == {
        "motor_velocity_rad_s": "n",
        "torque_n_m": "m",
    }


def test_a_named_speed_tells_that_a_coarse_column_without_a_name_is_its_position(tmp_path: Path) -> None:
    """The speed explains the torque better than 12 counts of a turn, and is their derivative."""
    steps = np.round(AXIS["angle"] / (2.0 * np.pi / 12.0))
    quiet = np.convolve(AXIS["speed"], np.ones(9) / 9.0, mode="same")
    columns = {"t_s": AXIS["t"], "word_3": steps, "speed_rad_s": quiet, "torque_Nm": AXIS["torque"]}
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {one.channel: one.entry["column"] for one in draft.channels}["motor_position_rad"] == "word_3"


@pytest.mark.parametrize(("lead_s", "channel"), [(0.004, "position_command_m"), (-0.004, "table_position_m")])
def test_a_position_without_a_word_beside_a_measured_one_is_a_set_point_if_it_comes_before(
    tmp_path: Path, lead_s: float, channel: str
) -> None:
    """Both explain the torque worse than the motor's: a load that lags is a second encoder."""
    count = 2 * np.pi / 8192
    other = np.round(np.interp(AXIS["t"] + lead_s, AXIS["t"], AXIS["angle"]) / count)
    columns = {"t_s": AXIS["t"], "lim_pos_cnt": other, "act_pos_cnt": np.round(AXIS["angle"] / count)}
    draft = draft_map(write(tmp_path / "log.csv", {**columns, "torque_Nm": AXIS["torque"]}))
    found = {one.channel: one.entry["column"] for one in draft.channels}
    assert (found["motor_position_rad"], found[channel]) == ("act_pos_cnt", "lim_pos_cnt")


def test_row_numbers_are_no_torque_where_one_is_named(tmp_path: Path) -> None:
    columns = {"No": np.arange(1.0, AXIS["t"].size + 1), "t": AXIS["t"], "n": AXIS["speed"], "torque": AXIS["torque"]}
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {str(one.entry["column"]) for one in draft.channels} == {"n", "torque"}


OTHER = {"angle": AXIS["angle"][::-1] * np.sin(AXIS["t"]), "torque": AXIS["torque"][::-1] * np.cos(5.0 * AXIS["t"])}
NAMED = [
    ("ActPos [u1, {}]", "CmdTorque [u1, {}]", "1", "2"),
    ("pos({})", "torque({})", "1", "2"),
    ("Pos{} [rad]", "Torque{} [Nm]", "X", "Y"),
    ("{}_act_position_rad", "{}_act_torque_Nm", "x", "z"),
    ("Axis {} angle (rad)", "Axis {} torque (Nm)", "C", "B"),
]


@pytest.mark.parametrize(("position", "torque", "own", "other"), NAMED)
@pytest.mark.parametrize("asked", [False, True])
def test_columns_of_another_axis_are_left_out_with_a_hint_at_axis(
    tmp_path: Path, position: str, torque: str, own: str, other: str, asked: bool
) -> None:
    columns = {"time_s": AXIS["t"], position.format(own): AXIS["angle"], position.format(other): OTHER["angle"],
               torque.format(own): AXIS["torque"], torque.format(other): OTHER["torque"]}  # fmt: skip
    draft = draft_map(write_quoted(tmp_path / "log.csv", columns), axis=own if asked else other.upper())
    wanted = own if asked else other
    used = [str(one.entry["column"]) for one in draft.channels]
    assert used == [position.format(wanted), torque.format(wanted)]
    assert len(draft.left_out) == 2
    hint = draft_map(tmp_path / "log.csv").unsure[0]
    assert f"--axis {max(own, other).lower()}" in hint or f"--axis {min(own, other).lower()}" in hint


def write_quoted(path: Path, columns: dict[str, np.ndarray]) -> Path:
    write(path, columns)
    _, _, rows = path.read_text().partition("\n")
    path.write_text(",".join(f'"{name}"' for name in columns) + "\n" + rows)
    return path


def test_a_position_that_does_not_follow_is_no_second_encoder(tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "motor_angle_rad": AXIS["angle"], "angle of the feeder [rad]": OTHER["angle"],
               "torque_Nm": AXIS["torque"]}  # fmt: skip
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert [one.channel for one in draft.channels] == ["motor_position_rad", "torque_n_m"]
    assert "does not follow motor_angle_rad" in draft.left_out["angle of the feeder [rad]"]


@pytest.mark.parametrize(("values", "noted"), [(OTHER["torque"], True), (AXIS["torque"], False)])
def test_a_torque_of_another_axis_by_its_name_is_said_where_the_motion_does_not_explain_it(
    tmp_path: Path, values: np.ndarray, noted: bool
) -> None:
    columns = {"time_s": AXIS["t"], "X1_speed_rad_s": AXIS["speed"], "Y_torque_Nm": values}
    draft = draft_map(write(tmp_path / "log.csv", columns))
    note = "Y_torque_Nm: by its name of axis y, X1_speed_rad_s of axis 1; check that it drives this axis"
    assert (note in draft.unsure) is noted


@pytest.mark.parametrize(("unit", "size", "table"), [("mm", 1e3 * 0.01 / (2 * np.pi), True), ("deg", 57.296, False)])
def test_an_angle_beside_a_length_is_no_set_point(tmp_path: Path, unit: str, size: float, table: bool) -> None:
    """A wheel on the carriage is noisier than the motor's encoder; a set-point has the unit of the axis."""
    noisy = size * (AXIS["angle"] + np.random.default_rng(4).normal(0.0, 0.05, AXIS["t"].size))
    columns = {"t_s": AXIS["t"], "pos_deg": np.degrees(AXIS["angle"]), f"wheel_{unit}": noisy, "trq_Nm": AXIS["torque"]}
    draft = draft_map(write(tmp_path / "log.csv", columns))
    found = {one.channel: str(one.entry["column"]) for one in draft.channels}
    assert (found.get("table_position_m") == "wheel_mm") is table
    assert ("position_command_m" in found) is not table


@pytest.mark.parametrize(
    ("speed", "other", "effort"),
    [
        ("Drehzahl_1/min", "Moment_Ist_%", "Moment_Ist_%"),
        ("Winkelgeschwindigkeit_rad/s", "Moment_Ist_%", "Moment_Ist_%"),
        ("Tempo_mm/s", "Moment_Ist_%", "Kraft_kN"),
        ("Spindel_Drehzahl_1/min", "Moment_Ist_%", "Kraft_kN"),  # of another motor
        ("Drehzahl_1/min", "Strom_A", "Kraft_kN"),  # of a drive that computes it
    ],
)
def test_a_force_beside_a_motor_that_turns_is_not_its_own(tmp_path: Path, speed: str, other: str, effort: str) -> None:
    """A load cell, even where the motion explains it better than the torque of the motor."""
    random = np.random.default_rng(3)
    noise, factor = random.normal(0.0, 0.2, AXIS["t"].size), {"1/min": 30.0 / np.pi, "mm/s": 5.0 / np.pi}
    columns = {
        "Zeit_s": AXIS["t"],
        "Lage_Ist_mm": AXIS["x_act"],
        speed: AXIS["speed"] * factor.get(speed.rpartition("_")[2], 1.0),
        other: 10.0 * (AXIS["torque"] + noise),
        "Kraft_kN": 0.6 * AXIS["torque"],
    }
    if "Spindel" in speed:
        columns[speed] = random.normal(3000.0, 5.0, AXIS["t"].size)
    chosen = [one.entry["column"] for one in draft_map(write(tmp_path / "log.csv", columns)).channels]
    assert effort in chosen
    assert not {other, "Kraft_kN"} - {effort} & set(chosen)
