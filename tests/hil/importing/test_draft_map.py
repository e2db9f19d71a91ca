"""A map is drafted from the file alone: dialects, languages, units, roles and signs of a known axis."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_axis import LEAD_M, answered, axis, csv_text, renamed, write

from hil.commands.import_ import import_
from hil.errors import InputError
from hil.files.json_columns import read_json
from hil.importing.by_map import import_recording
from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text
from hil.recording.recording import Recording, read_recording

AXIS = axis()
NAMES = {"t": "time_s", "x_set": "position_setpoint_mm", "angle": "motor_angle_rad", "torque": "torque_Nm"}
ENGLISH = renamed(AXIS, **NAMES)


def imported(path: Path) -> Recording:
    target = path.with_suffix(".out.parquet")
    import_(path, None, target, None, None)
    return read_recording(target)


def channels(draft: MapDraft) -> dict[str, Any]:
    return {one.channel: one.entry for one in draft.channels}


def check(recording: Recording) -> None:
    """The known axis in SI: motor in rad, set-point in m, torque in N m."""
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"], atol=1e-5)
    np.testing.assert_allclose(recording["position_command_m"], 1e-3 * AXIS["x_set"], atol=1e-8)
    np.testing.assert_allclose(recording["torque_n_m"], AXIS["torque"], atol=1e-5)


@pytest.mark.parametrize("ending", ["csv", "mat", "parquet", "json"])
def test_each_format_is_imported_without_a_map(tmp_path: Path, ending: str) -> None:
    check(imported(write(tmp_path / f"log.{ending}", ENGLISH)))


@pytest.mark.parametrize(
    ("delimiter", "comma", "above", "below"),
    [
        (",", False, "", ""),
        (";", False, "", ""),
        (";", True, "", ""),
        ("\t", False, "", ""),
        ("\t", True, "", ""),
        ("|", False, "", ""),
        (" ", False, "", ""),
        ("   ", False, "", ""),
        (",", False, "# recorded on Monday\n# drive 3\n", ""),
        (";", True, "Messung 7\nAntrieb X\n\n", ""),
        (",", False, "", "s,mm,rad,Nm\n"),
        (";", True, "", "[s];[mm];[rad];[Nm]\n"),
        (",", False, "%", ""),
    ],
)
def test_each_dialect_is_read(tmp_path: Path, delimiter: str, comma: bool, above: str, below: str) -> None:
    path = tmp_path / "log.csv"
    names = dict(zip(NAMES, ("time", "position_setpoint", "motor_angle", "torque"), strict=True)) if below else NAMES
    path.write_text(csv_text(renamed(AXIS, **names), delimiter, comma, above, below))
    check(imported(path))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_each_encoding_is_read(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "log.csv"
    columns = renamed(
        AXIS | {"angle": np.rad2deg(AXIS["angle"])},
        t="Zeit [s]",
        x_set="Sollposition [mm]",
        angle="Winkel Motor [°]",
        torque="Moment [Nm]",
    )
    path.write_bytes(csv_text(columns, ";", comma=True).encode(encoding))
    check(imported(path))


@pytest.mark.parametrize(
    "names",
    [
        ("Zeit [ms]", "Lagesollwert [mm]", "Motorlage Istwert [rad]", "Drehmoment [Nm]"),
        ("t/ms", "x_soll/mm", "phi_ist/rad", "M_ist/Nm"),
        ("Temps (ms)", "Consigne position (mm)", "Position moteur (rad)", "Couple (Nm)"),
        ("timestamp_ms", "RefPosition [mm]", "ActPosition [rad]", "ActTorque [Nm]"),
        ("time in ms", "target position in mm", "motor position in rad", "motor torque in Nm"),
    ],
)
def test_names_in_three_languages_give_the_channels(tmp_path: Path, names: tuple[str, ...]) -> None:
    columns = renamed(AXIS | {"t": 1e3 * AXIS["t"]}, **dict(zip(NAMES, names, strict=True)))
    check(imported(write(tmp_path / "log.csv", columns)))


def test_columns_without_telling_names_are_told_by_their_relations(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="c1", x_act="c2", torque="c3")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert draft.clock.time
    assert draft.clock.time.column == "c1"
    assert channels(draft)["motor_position_m"]["column"] == "c2"
    assert channels(draft)["force_n"]["column"] == "c3"
    assert len([note for note in draft.unsure if "its name says nothing" in note]) == 2


def test_a_velocity_is_recognised_as_the_derivative(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="c1", angle="c2", speed="c3", torque="c4")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert "velocity" in draft.left_out["c3"]
    assert next(iter(channels(draft).values()))["column"] == "c2"


def test_a_unit_follows_from_a_velocity_with_a_unit(tmp_path: Path) -> None:
    changed = AXIS | {"angle": np.rad2deg(AXIS["angle"]), "speed": AXIS["speed"] * 60 / (2 * np.pi)}
    columns = renamed(changed, t="time_s", angle="motor_position", speed="speed [rpm]", torque="torque [Nm]")
    assert channels(draft_map(write(tmp_path / "log.csv", columns)))["motor_position_rad"]["unit"] == "deg"


def test_the_lead_follows_from_two_encoders(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="time_s", x_act="table_position_mm", angle="motor_angle_rad", torque="torque_Nm")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert draft.lead_m == pytest.approx(LEAD_M, rel=1e-3)
    assert {"motor_position_rad", "table_position_m", "torque_n_m"} == set(channels(draft))


@pytest.mark.parametrize(("column", "channel"), [("torque", "torque_n_m"), ("x_set", "position_command_m")])
def test_a_turned_sign_is_turned_back_and_named(tmp_path: Path, column: str, channel: str) -> None:
    path = write(tmp_path / "log.csv", renamed(AXIS | {column: -AXIS[column]}, **NAMES))
    draft, recording = draft_map(path), imported(path)
    assert any("sign" in note for note in draft.unsure)
    axis_sign = np.sign(np.corrcoef(recording["motor_position_rad"], recording["position_command_m"])[0, 1])
    assert axis_sign == 1.0
    acceleration = np.gradient(np.gradient(recording["motor_position_rad"]))
    smooth = np.convolve(acceleration, np.ones(51) / 51, "same")
    assert np.corrcoef(smooth[100:-100], recording["torque_n_m"][100:-100])[0, 1] > 0.2, channel


@pytest.mark.parametrize(
    ("changed", "asked", "factor"),
    [
        ({"torque": "i_q [A]"}, {"torque_constant_n_m_a": 0.5}, 0.5),
        ({"torque": "output 2 [V]"}, {"gain": 0.5}, 0.5),
        ({"torque": "Drehmoment [%]"}, {"rated": 2.4}, 0.024),
        ({"torque": "Drehmoment [1/1000]"}, {"rated": 2.4}, 0.0024),
        ({"torque": "torque"}, {"unit": "mN m"}, 1e-3),
    ],
)
def test_what_the_file_does_not_tell_is_asked_and_taken_from_the_map(
    tmp_path: Path, changed: dict[str, str], asked: dict[str, object], factor: float
) -> None:
    """The map has the key without a value, the message its line; with the value the file is imported."""
    path, target = write(tmp_path / "log.csv", renamed(AXIS, **(NAMES | changed))), tmp_path / "log.parquet"
    (key,) = asked
    with pytest.raises(InputError, match=rf"log-map\.yaml:\d+: {key}: .*write"):
        import_(path, None, target, None, None)
    map_path = tmp_path / "log-map.yaml"
    with pytest.raises(InputError, match=r"log-map\.yaml:\d+: channels\.torque"):
        import_(path, str(map_path), target, None, None)
    map_path.write_text(answered(map_path.read_text(), **asked))
    import_(path, str(map_path), target, None, None)
    recording = read_recording(target)
    np.testing.assert_allclose(np.abs(recording["torque_n_m"]), factor * np.abs(AXIS["torque"]), atol=1e-5)


@pytest.mark.parametrize(
    ("columns", "asked"),
    [
        ({"angle": "encoder [counts]", "torque": "torque_Nm"}, {"counts_per_rev": 2048}),
        ({"angle": "pos", "torque": "torque_Nm"}, {"unit": "mrad"}),
        ({"speed": "speed", "torque": "torque_Nm"}, {"unit": "rpm"}),
        ({"x_act": "stage [mm]", "torque": "current [A]"}, {"force_constant_n_a": 30.0}),
        ({"x_act": "stage [mm]", "torque": "torque [Nm]"}, {"lead_m": 0.01}),
    ],
)
def test_the_unit_of_a_motion_and_the_constants_of_a_motor_are_asked(
    tmp_path: Path, columns: dict[str, str], asked: dict[str, object]
) -> None:
    step = 2.0 * np.pi / 2048 if "counts" in str(columns) else 1e-3  # a step of digits tells no counts per turn
    counts = {"angle": np.round(AXIS["angle"] / step) * (1.0 if step > 1e-3 else step)}
    path, map_path = write(tmp_path / "log.csv", renamed(AXIS | counts, t="t_s", **columns)), tmp_path / "map.yaml"
    draft = draft_map(path)
    assert [one.key for one in draft.asked] == list(asked)
    map_path.write_text(answered(map_text(draft), **asked))
    assert len(import_recording(path, map_path)) == len(AXIS["t"])


def test_volts_of_monitor_outputs_are_told_apart_and_their_scales_asked(tmp_path: Path) -> None:
    volts = {"speed": AXIS["speed"] / 400.0, "torque": -AXIS["torque"]}
    path, map_path = tmp_path / "log.csv", tmp_path / "map.yaml"
    write(path, renamed(AXIS | volts, t="t_s", torque="A [V]", speed="B [V]"))
    draft = draft_map(path)
    assert {one.key for one in draft.asked} == {"unit", "scale", "gain"}
    map_path.write_text(answered(map_text(draft), unit="rad/s", scale=400.0, gain=1.0))
    recording = import_recording(path, map_path)
    np.testing.assert_allclose(recording["motor_velocity_rad_s"], AXIS["speed"], atol=1e-4)
    np.testing.assert_allclose(recording["torque_n_m"], AXIS["torque"], atol=1e-5)


def test_of_several_axes_one_is_taken_and_the_others_are_named(tmp_path: Path) -> None:
    both = {"time_s": AXIS["t"]}
    for number, factor in (("1", 1.0), ("2", 0.5)):
        both |= {f"position{number}_rad": factor * AXIS["angle"], f"torque{number}_n_m": AXIS["torque"]}
    path = write(tmp_path / "log.csv", both)
    assert channels(draft_map(path))["motor_position_rad"]["column"] == "position1_rad"
    assert any("--axis 2" in note for note in draft_map(path).unsure)
    assert channels(draft_map(path, axis="2"))["motor_position_rad"]["column"] == "position2_rad"


def test_uneven_stamps_are_interpolated_and_said(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    uneven = AXIS["t"] + random.uniform(0.0, 4e-4, AXIS["t"].size)
    columns = {name: np.interp(uneven, AXIS["t"], values) for name, values in AXIS.items()} | {"t": uneven}
    path = write(tmp_path / "log.csv", renamed(columns, **NAMES))
    assert draft_map(path).resample_hz == pytest.approx(1000.0, rel=0.02)
    assert imported(path).period_s == pytest.approx(1e-3, rel=0.02)


@pytest.mark.parametrize(
    "content",
    [
        lambda c: {"signals": {k: v.tolist() for k, v in c.items() if k != "t"}, "fs": 1000.0},
        lambda c: [{k: float(v[i]) for k, v in c.items()} for i in range(len(AXIS["t"]))],
        lambda c: {"columns": list(c), "data": np.column_stack(list(c.values())).tolist()},
        lambda c: [{"name": k, "values": v.tolist()} for k, v in c.items()],
        lambda c: {"rig": "arm 2", "signals": {k: {"data": v.tolist()} for k, v in c.items()}},
    ],
)
def test_json_in_the_forms_that_tools_write(tmp_path: Path, content: Any) -> None:
    path = tmp_path / "log.json"
    path.write_text(json.dumps(content(ENGLISH)))
    check(imported(path))


def test_an_object_of_lists_is_no_channel(tmp_path: Path) -> None:
    """Whatever their names are."""
    path = tmp_path / "log.json"
    path.write_text(json.dumps({"recording": {**{k: v.tolist() for k, v in ENGLISH.items()}, "data": [1.0, 2.0]}}))
    assert set(read_json(path).lists) == {*ENGLISH, "data"}


def test_a_message_per_row_is_a_joint_state_of_ros(tmp_path: Path) -> None:
    """Stamps are seconds and nanoseconds, positions and efforts lists in the order of the names; rad and N m."""
    angle, torque = AXIS["angle"], AXIS["torque"]
    messages = [
        {
            "header": {"seq": index, "stamp": {"secs": 1_700_000_000 + int(t), "nsecs": round(1e9 * (t % 1.0))}},
            "name": ["joint_motor", "joint_link"],
            "position": [angle[index], 0.01 * angle[index]],
            "effort": [torque[index], 0.0],
        }
        for index, t in enumerate(AXIS["t"])
    ]
    path = tmp_path / "joint.json"
    path.write_text(json.dumps(messages))
    recording = imported(path)
    assert recording.period_s == pytest.approx(float(AXIS["t"][1] - AXIS["t"][0]), rel=1e-4)
    np.testing.assert_allclose(recording["motor_position_rad"], angle, atol=1e-6)
    np.testing.assert_allclose(recording["table_position_m"], 0.01 * angle, atol=1e-6)
    np.testing.assert_allclose(recording["torque_n_m"], torque, atol=1e-6)


@pytest.mark.parametrize(
    ("column", "unit", "quantity"),
    [
        ("Kraft kN", "kN", "effort"),
        ("Torque N m", "N m", "effort"),
        ("Drehzahl 1/min", "rpm", "velocity"),
        ("Time s", "s", "time"),
        ("Strom A", "A", "effort"),
        ("Encoder A", None, "position"),
        ("Position actual value", None, "position"),
        ("Position [in]", "in", "position"),
        ("position in", None, "position"),
    ],
)
def test_a_unit_after_a_blank_is_read(column: str, unit: str | None, quantity: str) -> None:
    read = label(column)
    assert (read.unit, read.quantity.value, read.odd_unit) == (unit, quantity, False)


def test_a_rate_is_taken_from_a_comment_or_the_user(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    columns = renamed(AXIS, **{k: v for k, v in NAMES.items() if k != "t"})
    path.write_text(csv_text(columns, above="# sampling rate: 2 kHz\n"))
    assert draft_map(path).clock.rate_hz == 2000.0
    assert draft_map(path, rate_hz=500.0).clock.rate_hz == 500.0


def test_a_wrong_unit_of_the_stamps_is_corrected_and_named(tmp_path: Path) -> None:
    draft = draft_map(write(tmp_path / "log.csv", renamed(AXIS, **(NAMES | {"t": "time [ms]"}))))
    assert draft.clock.time
    assert draft.clock.time.unit == "s"
    assert any("no rate of a recording" in note for note in draft.unsure)


@pytest.mark.parametrize("unit", ["Counts16Bit", "cnt", "inc"])
def test_the_size_of_a_count_follows_from_a_speed(tmp_path: Path, unit: str) -> None:
    """Set-points of the drive are in the same counts."""
    counts = {"angle": np.round(AXIS["angle"] * 65536 / (2 * np.pi)), "speed": AXIS["speed"] * 60 / (2 * np.pi)}
    counts["x_set"] = 1e-3 * AXIS["x_set"] / LEAD_M * 65536
    names = {"angle": f"Position Feedback ({unit})", "speed": "Velocity Feedback (rpm)", "torque": "Torque (Nm)"}
    columns = renamed(AXIS | counts, t="Time (s)", x_set=f"Position Command ({unit})", **names)
    draft = draft_map(write(tmp_path / "log.csv", columns))
    found = channels(draft)
    assert found["motor_position_rad"]["counts_per_rev"] == 65536
    assert found["position_command_m"]["scale"] == pytest.approx(2 * np.pi / 65536, rel=1e-6)
    assert draft.lead_m == pytest.approx(2 * np.pi)


def test_columns_of_a_joint_state_are_in_rad(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="secs", angle="position", speed="velocity", torque="effort")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert channels(draft)["motor_position_rad"]["unit"] == "rad"
    assert any("joint state" in note for note in draft.unsure)


def test_units_of_a_scope_with_a_time_beside_each_channel_are_read(tmp_path: Path) -> None:
    head = "Name;ActPos;Name;ActTorque\nUnit;deg;Unit;Nm\nSampletime[ms];1;Sampletime[ms];1\n\n"
    rows = zip(1e3 * AXIS["t"], np.rad2deg(AXIS["angle"]), AXIS["torque"], strict=True)
    path = tmp_path / "log.csv"
    path.write_text(head + "".join(f"{t:.0f};{angle:.6f};{t:.0f};{torque:.5f}\n" for t, angle, torque in rows))
    found = channels(draft_map(path))
    assert (found["motor_position_rad"]["unit"], found["torque_n_m"]["unit"]) == ("deg", "N m")


@pytest.mark.parametrize("name", ["Istwinkel [Grad]", "istposition [mm]", "ActPos"])
def test_a_measured_position_is_told_by_its_name(name: str) -> None:
    assert label(name).quantity == "position"


@pytest.mark.parametrize("turned", [(), ("torque_command_Nm",), ("torque_measured_Nm",)])
def test_torque_and_command_get_signs_that_agree(tmp_path: Path, turned: tuple[str, ...]) -> None:
    """Another axis pushes this one: alone, the measured torque seems to accelerate backwards."""
    random = np.random.default_rng(2)
    from_other = 6.5e-4 * np.gradient(AXIS["speed"], AXIS["t"]) + random.normal(0.0, 0.5, AXIS["t"].size)
    friction = 1.2 * np.sign(AXIS["speed"])
    columns = {
        "time_s": AXIS["t"],
        "motor_angle_rad": AXIS["angle"],
        "torque_command_Nm": friction,
        "torque_measured_Nm": friction - np.convolve(from_other, np.ones(21) / 21, "same"),
    }
    changed = {name: -part if name in turned else part for name, part in columns.items()}
    found = channels(draft_map(write(tmp_path / "log.csv", changed)))
    assert found["torque_command_n_m"].get("sign", 1) == (-1 if "torque_command_Nm" in turned else 1)
    assert found["torque_n_m"].get("sign", 1) == (-1 if "torque_measured_Nm" in turned else 1)


def test_two_positions_without_a_torque_are_two_encoders(tmp_path: Path) -> None:
    angle = np.round(np.degrees(AXIS["angle"]) / 0.01) * 0.01
    turned = np.round(angle / 18.0 / 0.1)
    columns = {"time_s": AXIS["t"], "motor_angle_deg": angle, "stage_angle (0.1 deg)": turned}
    recording = imported(write(tmp_path / "stage.csv", columns))
    np.testing.assert_allclose(recording["table_position_m"], np.radians(0.1 * turned), atol=1e-9)
    assert recording.metadata["lead_m"] == pytest.approx(2.0 * np.pi)
