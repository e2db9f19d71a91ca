"""One known axis in the forms that loggers and users give it: names without meaning, structures, wraps, stamps."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_axis import LEAD_M, answered, axis, renamed, write

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.foreign_table import read_table
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text
from hil.recording.recording import Recording

AXIS = axis()
NAMES = {"t": "time_s", "x_set": "position_setpoint_mm", "angle": "motor_angle_rad", "torque": "torque_Nm"}
COUNTS = np.round(AXIS["angle"] / (2 * np.pi) * 4096)


def imported(path: Path) -> tuple[MapDraft, Recording]:
    draft = draft_map(path)
    text = path.with_name("map.yaml")
    text.write_text(map_text(draft))
    return draft, import_recording(path, text)


def entries(draft: MapDraft) -> dict[str, dict[str, Any]]:
    return {one.channel: one.entry for one in draft.channels}


def dated(form: Callable[[int, float], str]) -> Callable[[Path], None]:
    """A writer of the known axis with stamps of text."""

    def make(path: Path) -> None:
        columns = renamed(AXIS, **{key: name for key, name in NAMES.items() if key != "t"})
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        lines = [
            ";".join([form(int(t // 60), t % 60), *(f"{value:.9g}" for value in row)])
            for t, row in zip(AXIS["t"], rows, strict=True)
        ]
        path.write_text("\n".join([";".join(["Zeit", *columns]), *lines]) + "\n")

    return make


def simulink(path: Path) -> None:
    from scipy.io import savemat

    signals = [{"values": AXIS[key].reshape(-1, 1), "label": name} for key, name in NAMES.items() if key != "t"]
    savemat(path, {"logsout": {"time": AXIS["t"], "signals": signals}})


def measured_structure(path: Path) -> None:
    from scipy.io import savemat

    told = {"t": ("time", "s"), "x_set": ("pos_cmd", "mm"), "angle": ("angle_act", "rad"), "torque": ("trq_act", "Nm")}
    signals = {name: {"data": AXIS[key], "unit": unit} for key, (name, unit) in told.items()}
    savemat(path, {"rec": {"meta": {"fs": 1000.0}, "signals": signals}})


def twincat(path: Path) -> None:
    names = "Name;SetPos [mm];Name;ActAngle [rad];Name;ActTorque [Nm]"
    above = f"Name;Project\nFile;a.svdx\n\n{names}\nSampleTime;1;SampleTime;1;SampleTime;1"
    rows = zip(1e3 * AXIS["t"], AXIS["x_set"], AXIS["angle"], AXIS["torque"], strict=True)
    lines = [f"{t:g};{x:.9g};{t:g};{angle:.9g};{t:g};{torque:.9g}" for t, x, angle, torque in rows]
    path.write_text("\n".join([above, "", *lines]) + "\n")


def twincat_filled(path: Path) -> None:
    """As TwinCAT writes it: lines about the file are as wide as the rows, units stand in a row of their own."""
    names = "Name\tAxis1.SetPos\tName\tAxis1.ActAngle\tName\tAxis1.ActTorque"
    comment = "SymbolComment\tmm\tSymbolComment\trad\tSymbolComment\tNm"
    facts = "Name\tScope Project\t\t\t\t\nFile\ta.svdx\t\t\t\t\nStarttime\t133547712\tTuesday\t14:20:00.000\t\t"
    times = "SampleTime[ms]\t1\tSampleTime[ms]\t1\tSampleTime[ms]\t1"
    rows = zip(1e3 * AXIS["t"], AXIS["x_set"], AXIS["angle"], AXIS["torque"], strict=True)
    lines = [f"{t:g}\t{x:.9g}\t{t:g}\t{angle:.9g}\t{t:g}\t{torque:.9g}" for t, x, angle, torque in rows]
    path.write_text("\n".join([facts, "\t" * 5, names, comment, times, "\t" * 5, *lines]) + "\n")


@pytest.mark.parametrize(
    ("ending", "make"),
    [
        ("csv", dated(lambda minute, second: f"2024-03-01 12:{minute:02d}:{second:06.3f}")),
        ("csv", dated(lambda minute, second: f"01.03.2024 12:{minute:02d}:{second:06.3f}")),
        ("csv", dated(lambda minute, second: f"12:{minute:02d}:{second:06.3f}")),
        ("csv", dated(lambda minute, second: f"{45352.5 + (60 * minute + second) / 86400:.13f}")),
        ("mat", simulink),
        ("mat", measured_structure),
        ("csv", twincat),
        ("csv", twincat_filled),
        ("csv", lambda path: write(path, renamed(AXIS | {"t": 1.7e9 + AXIS["t"]}, **NAMES))),
    ],
    ids=[
        "date",
        "German date",
        "time of day",
        "day number",
        "Simulink structure",
        "structures with data and unit",
        "TwinCAT Scope",
        "TwinCAT Scope, filled",
        "since 1970",
    ],
)
def test_the_axis_is_imported_from_what_loggers_write(
    tmp_path: Path, ending: str, make: Callable[[Path], None]
) -> None:
    path = tmp_path / f"log.{ending}"
    make(path)
    if path.suffix == ".csv" and path.read_text().startswith("time_s"):  # with the digits of the clock
        lines = [
            f"{1.7e9 + t:.4f},{line.split(',', 1)[1]}"
            for t, line in zip(AXIS["t"], path.read_text().splitlines()[1:], strict=True)
        ]
        path.write_text("\n".join([",".join(NAMES.values()), *lines]) + "\n")
    _, recording = imported(path)
    assert recording.period_s == pytest.approx(1e-3, rel=1e-4)
    assert len(recording.parts()) == 1
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"], atol=1e-5)
    np.testing.assert_allclose(recording["position_command_m"], 1e-3 * AXIS["x_set"], atol=1e-8)
    np.testing.assert_allclose(recording["torque_n_m"], AXIS["torque"], atol=1e-5)


@pytest.mark.parametrize(
    ("values", "name", "size"),
    [
        (np.mod(COUNTS, 65536), "enc_counts", 65536.0),
        (np.mod(COUNTS + 32768, 65536) - 32768, "enc_counts", 65536.0),
        (np.mod(COUNTS, 4096), "enc_counts", 4096.0),
        (np.mod(np.rad2deg(AXIS["angle"]), 360.0), "angle_deg", 360.0),
    ],
)
def test_a_counter_that_wraps_is_unwrapped_and_said(tmp_path: Path, values: np.ndarray, name: str, size: float) -> None:
    columns = {"time_s": AXIS["t"], name: values, "table_mm": AXIS["x_act"], "torque_Nm": AXIS["torque"]}
    draft, recording = imported(write(tmp_path / "log.csv", columns))
    entry = entries(draft)["motor_position_rad"]
    assert entry["column"] == name
    assert entry["wraps_at"] == size
    assert f"{name}: wraps at {size:g}; it is unwrapped" in draft.unsure
    moved = recording["motor_position_rad"] - recording["motor_position_rad"][0]
    np.testing.assert_allclose(moved, AXIS["angle"] - AXIS["angle"][0], atol=4e-3)
    assert draft.lead_m == pytest.approx(LEAD_M, rel=1e-3)


def test_spikes_are_left_out_and_a_torque_at_its_limit_is_said(tmp_path: Path) -> None:
    columns = renamed(AXIS, **NAMES)
    position, torque = (
        next(name for name, values in columns.items() if values is AXIS[key]) for key in ("angle", "torque")
    )
    spiked = AXIS["angle"].copy()
    spiked[[500, 1500]] += 0.02 * np.ptp(spiked)
    limit = 0.6 * np.abs(AXIS["torque"]).max()
    odd = columns | {position: spiked, torque: np.clip(AXIS["torque"], -limit, limit)}
    draft, recording = imported(write(tmp_path / "log.csv", odd))
    assert any(one.startswith(f"spikes: {position} is off the motion for one row in 2 places") for one in draft.unsure)
    assert any(one.startswith(f"{torque}: stays at {limit:.4g} in") for one in draft.unsure)
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"], atol=2e-3 * np.ptp(AXIS["angle"]))
    assert not any("stays at" in one for one in imported(write(tmp_path / "whole.csv", columns))[0].unsure)


def test_a_position_sampled_more_slowly_than_the_torque_is_said_and_kept_once(tmp_path: Path) -> None:
    columns = renamed(AXIS, **NAMES)
    position = next(name for name, values in columns.items() if values is AXIS["angle"])
    held = np.arange(AXIS["t"].size) // 4 * 4
    draft, recording = imported(write(tmp_path / "log.csv", columns | {position: AXIS["angle"][held]}))
    assert draft.rows_per_sample == 4.0
    assert any(f"each stands in 4 rows ({position}: sampled more slowly than the rows)" in one for one in draft.unsure)
    assert recording.period_s == pytest.approx(4e-3)
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"][::4], atol=1e-5)


def test_repeated_samples_are_said_and_kept_once(tmp_path: Path) -> None:
    columns = {name: np.repeat(values, 2) for name, values in renamed(AXIS, **NAMES).items()}
    columns["time_s"] = np.arange(2 * AXIS["t"].size) * 5e-4
    draft, recording = imported(write(tmp_path / "log.csv", columns))
    assert draft.rows_per_sample == 2.0
    assert any("each stands in 2 rows" in note for note in draft.unsure)
    assert recording.period_s == pytest.approx(1e-3)
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"], atol=1e-5)


def test_a_gap_and_missing_values_cut_the_file_into_parts_that_keep_their_time(tmp_path: Path) -> None:
    torque = AXIS["torque"].copy()
    torque[3000:3100] = np.nan
    kept = np.r_[0:1000, 1200:4000]
    columns = {name: values[kept] for name, values in renamed(AXIS | {"torque": torque}, **NAMES).items()}
    draft, recording = imported(write(tmp_path / "log.csv", columns))
    assert [part.start_s for part in recording.parts()] == pytest.approx([0.0, 1.2, 3.1])
    assert any("cut into 3 parts" in note for note in draft.unsure)
    # the derived velocity knows the gaps
    for part in recording.parts():
        rows = np.round(part["time_s"] / 1e-3).astype(int)
        np.testing.assert_allclose(
            part["velocity_command_m_s"], np.gradient(1e-3 * AXIS["x_set"][rows], 1e-3), atol=1e-5
        )


def test_two_encoders_without_units_are_a_screw_of_usual_lead(tmp_path: Path) -> None:
    columns = {"time": AXIS["t"], "motor_pos": AXIS["angle"], "table_pos": AXIS["x_act"], "torque": AXIS["torque"]}
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert entries(draft)["motor_position_rad"]["unit"] == "rad"
    assert entries(draft)["table_position_m"]["unit"] == "mm"
    assert draft.lead_m == pytest.approx(LEAD_M, rel=1e-3)


def test_a_set_point_after_the_motion_is_named(tmp_path: Path) -> None:
    late = np.interp(AXIS["t"] - 0.006, AXIS["t"], AXIS["x_act"])
    draft = draft_map(write(tmp_path / "log.csv", renamed(AXIS | {"x_set": late}, **NAMES)))
    assert any("comes 6 ms after motor_angle_rad" in note for note in draft.unsure)
    assert not any(
        "a set-point comes before" in note
        for note in draft_map(write(tmp_path / "good.csv", renamed(AXIS, **NAMES))).unsure
    )


def test_the_step_of_an_encoder_is_that_before_the_interpolation(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    uneven = AXIS["t"] + random.uniform(0.0, 4e-4, AXIS["t"].size)
    count = 2 * np.pi / 4096
    columns = {name: np.interp(uneven, AXIS["t"], values) for name, values in AXIS.items()} | {"t": uneven}
    columns["angle"] = np.round(columns["angle"] / count) * count
    _, recording = imported(write(tmp_path / "log.csv", renamed(columns, **NAMES)))
    assert recording.metadata["channels"]["motor_position_rad"]["step"] == pytest.approx(count, rel=1e-4)


@pytest.mark.parametrize(
    ("scalars", "gain"), [({"gtau": 35.0}, "gtau"), ({"tau_filter": 0.01, "max_torque": 9.0}, None)]
)
def test_only_a_constant_by_its_name_scales_the_torque(
    tmp_path: Path, scalars: dict[str, float], gain: str | None
) -> None:
    columns: dict[str, Any] = renamed(AXIS, t="t", x_set="qg", x_act="qm", torque="vir") | scalars
    entry = entries(draft_map(write(tmp_path / "log.mat", columns)))["force_n"]
    assert entry["column"] == "vir"
    assert entry.get("gain") == gain


def test_a_joint_of_a_robot_is_read_in_rad_and_n_m(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="stamp", torque="tau")
    columns |= {"q": AXIS["angle"] / 60.0, "qd": np.gradient(AXIS["angle"] / 60.0, 1e-3)}
    found = entries(draft_map(write(tmp_path / "arm.csv", columns)))
    assert found["motor_position_rad"] == {"column": "q", "unit": "rad"}
    assert found["torque_n_m"] == {"column": "tau", "unit": "N m"}


@pytest.mark.parametrize(("turn", "unit"), [(2.0 * np.pi, "rad"), (360.0, "deg")])
def test_whole_turns_of_a_set_point_tell_its_unit(tmp_path: Path, turn: float, unit: str) -> None:
    turns = {"theta_ref": AXIS["x_set"] / np.ptp(AXIS["x_set"]), "theta": AXIS["x_act"] / np.ptp(AXIS["x_set"])}
    columns = renamed(AXIS, t="time", torque="torque") | {name: 5.0 * turn * x for name, x in turns.items()}
    found = entries(draft_map(write(tmp_path / "turns.csv", columns)))
    assert found["position_command_m"]["unit"] == found["motor_position_rad"]["unit"] == unit


def test_two_encoders_in_mm_are_a_screw_whose_lead_is_asked(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="t_s", torque="torque_Nm") | {
        "PosMotor_mm": AXIS["angle"] * 1e3 * LEAD_M / (2.0 * np.pi),
        "PosScale_mm": AXIS["x_act"],
    }
    path, map_path = write(tmp_path / "two.csv", columns), tmp_path / "map.yaml"
    draft = draft_map(path)
    assert [(one.channel, one.key) for one in draft.asked] == [("", "lead_m")]
    map_path.write_text(answered(map_text(draft), lead_m=LEAD_M))
    recording = import_recording(path, map_path)
    assert recording["motor_position_rad"] == pytest.approx(AXIS["angle"], abs=1e-3)
    assert "table_position_m" in recording.columns


def test_a_sparse_variable_and_an_element_of_no_type_end_in_no_crash(tmp_path: Path) -> None:
    from scipy.io import savemat
    from scipy.sparse import eye_array

    path = tmp_path / "log.mat"
    savemat(path, renamed(AXIS, **NAMES) | {"sparse": eye_array(3, format="csc")}, do_compression=False)
    assert "neither a number" in draft_map(path).left_out["sparse"]
    data = bytearray(path.read_bytes())
    data[136:140] = (2456).to_bytes(4, "little")  # type of the first element within the first variable
    path.write_bytes(data)
    with pytest.raises(InputError, match="an element has the type 2456, allowed those up to 18"):
        draft_map(path)


def test_more_columns_than_an_axis_has_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    path.write_text(json.dumps([{f"c{k}": 1.0 for k in range(1001)}] * 3))
    with pytest.raises(
        InputError, match="given 1001 columns of numbers, allowed 1000; export the channels of one axis"
    ):
        draft_map(path)


def test_a_vector_without_values_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, t=np.arange(10.0), angle=np.arange(10.0), nothing=np.empty(0))
    table = read_table(path)
    assert list(table.columns) == ["t", "angle"]
    assert "nothing: 0 rows, the other columns have 10: another rate, or cut" in table.remarks
