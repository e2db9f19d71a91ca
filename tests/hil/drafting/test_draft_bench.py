"""A bench file is drafted from a recording alone and gives back the axis that the recording was made of."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import COULOMB_N_M, INERTIA_KG_M2, LEAD_M, VISCOUS_N_M_S_RAD, axis, renamed, write
from own_recordings import CLEAN

import hil
from hil.bench.bench_file import load_bench
from hil.bench.control_section import Control, UnknownControl
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.drafting.bench_text import bench_text
from hil.drafting.draft_bench import draft_bench
from hil.drafting.ratio_values import gear_of, lead_of
from hil.errors import InputError
from hil.identification.least_squares import Estimate
from hil.recording.quantum import count_of
from hil.recording.recording import Recording, write_parquet
from hil.twin.mechanisms import gravity_torque

AXIS = axis(rows=8000)
SCREW = renamed(AXIS, t="time_s", x_act="table_position_mm", angle="motor_angle_rad", torque="torque_Nm")


def drafted(tmp_path: Path, columns: dict[str, np.ndarray]) -> Path:
    import_(write(tmp_path / "log.csv", columns), None, tmp_path / "log.parquet", None, None)
    identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    return tmp_path / "axis.yaml"


def test_the_axis_of_a_simulated_recording_is_found_with_its_law(tmp_path: Path) -> None:
    known, target = hil.load_bench("reference"), tmp_path / "axis.yaml"
    identify([CLEAN], target)
    bench = load_bench(target)
    assert bench.axis.model == "two_mass"
    assert bench.axis.lead_m == pytest.approx(0.010, rel=1e-4)
    assert bench.axis.motor_mass_kg + bench.axis.table_mass_kg == pytest.approx(335.0 + 384.0, rel=0.05)
    assert bench.axis.coulomb_torque_n_m == pytest.approx(known.axis.coulomb_torque_n_m, rel=0.05)  # type: ignore[union-attr]
    assert bench.axis.viscous_torque_n_m_s_rad == pytest.approx(0.0064, rel=0.2)
    assert isinstance(bench.control, Control)
    gains, true = bench.gains, known.gains
    assert gains.position_gain_1_s == pytest.approx(true.position_gain_1_s, rel=0.02)
    assert gains.velocity_gain_n_m_s_rad == pytest.approx(true.velocity_gain_n_m_s_rad, rel=0.02)
    assert gains.integral_gain_n_m_rad == pytest.approx(true.integral_gain_n_m_rad, rel=0.05)
    assert gains.position_ticks == true.position_ticks
    assert bench.encoders.motor.counts_per_rev == 2**20
    assert bench.encoders.table is not None
    assert bench.encoders.table.resolution_m == pytest.approx(0.5e-6, rel=1e-3)


def test_each_value_stands_within_its_error_and_beside_it_how_it_was_found(tmp_path: Path) -> None:
    path = drafted(tmp_path, SCREW)
    bench, text = load_bench(path), path.read_text()
    ratio = LEAD_M / (2 * np.pi)
    assert bench.axis.model == "rigid"  # no spring is told
    assert bench.axis.mass_kg == pytest.approx(INERTIA_KG_M2 / ratio**2, rel=0.02)
    assert bench.axis.coulomb_torque_n_m == pytest.approx(COULOMB_N_M, rel=0.05)
    assert bench.axis.viscous_torque_n_m_s_rad == pytest.approx(VISCOUS_N_M_S_RAD, rel=0.1)
    assert isinstance(bench.control, UnknownControl)
    for key in ("lead_m", "mass_kg", "coulomb_torque_n_m", "viscous_torque_n_m_s_rad"):
        line = next(line for line in text.splitlines() if line.strip().startswith(key))
        assert "+-" in line
        assert "over" in line


def test_one_encoder_and_torque_make_a_rotary_axis(tmp_path: Path) -> None:
    bench = load_bench(drafted(tmp_path, renamed(AXIS, t="time_s", angle="motor_angle_rad", torque="torque_Nm")))
    assert bench.axis.model == "rotary"
    assert bench.axis.inertia_kg_m2 == pytest.approx(INERTIA_KG_M2, rel=0.02)
    assert bench.encoders.motor.counts_per_rev == 2**17


def test_a_voltage_makes_a_dc_motor_in_volts(tmp_path: Path) -> None:
    path = drafted(tmp_path, renamed(AXIS, t="time_s", angle="motor_angle_rad", torque="voltage_command_V"))
    bench = load_bench(path)
    assert "torques of a diagnosis are volts" in path.read_text()
    assert bench.axis.model == "dc_motor"
    assert bench.axis.voltage_constant_v_s_rad == pytest.approx(VISCOUS_N_M_S_RAD, rel=0.1)
    assert bench.axis.time_constant_s == pytest.approx(INERTIA_KG_M2 / VISCOUS_N_M_S_RAD, rel=0.1)
    assert bench.axis.coulomb_voltage_v == pytest.approx(COULOMB_N_M, rel=0.05)


def test_gravity_over_the_angle_becomes_a_mechanism_of_the_bench(tmp_path: Path) -> None:
    weight = 3.0 * np.sin(AXIS["angle"] / 10.0 + 0.5)
    columns = {"time_s": AXIS["t"], "motor_angle_rad": AXIS["angle"] / 10.0, "torque_Nm": AXIS["torque"] + weight}
    bench = load_bench(drafted(tmp_path, columns))
    (entry,) = bench.mechanisms
    assert entry.effect == gravity_torque.MECHANISM.id
    assert entry.parameters["gravity_torque_n_m"] == pytest.approx(3.0, rel=2e-3)
    assert entry.parameters["angle_rad"] == pytest.approx(0.5, abs=2e-3)


def test_a_spring_on_a_load_that_turns_far_is_no_gravity(tmp_path: Path) -> None:
    angle = AXIS["angle"] / 10.0
    columns = {"time_s": AXIS["t"], "motor_angle_rad": angle, "torque_Nm": AXIS["torque"] + 1.2 * angle}
    path = drafted(tmp_path, columns)
    bench = load_bench(path)
    assert not bench.mechanisms
    assert bench.axis.inertia_kg_m2 == pytest.approx(100.0 * INERTIA_KG_M2 / 10.0, rel=0.02)
    assert "(a spring) 1.2 N m/rad" in path.read_text()


def test_a_lead_is_rounded_only_where_the_measured_one_agrees(tmp_path: Path) -> None:
    """Else a diagnosis would name the difference as an error of the screw."""
    near = load_bench(drafted(tmp_path, SCREW))
    assert near.axis.lead_m == LEAD_M
    (tmp_path / "far").mkdir()
    path = drafted(tmp_path / "far", SCREW | {"table_position_mm": 1.001 * SCREW["table_position_mm"]})
    assert load_bench(path).axis.lead_m == pytest.approx(1.001 * LEAD_M, rel=2e-5)
    assert "if its nominal lead is 10 mm write that" in path.read_text()


def test_a_following_error_of_the_set_points_is_no_gear() -> None:
    """Set-points that a loop follows by 80 % to 110 % say no more than that the ratio is one."""
    low, middle, high = (np.sin(frequency * AXIS["t"]) for frequency in (2.0, 5.0, 11.0))
    columns = {"motor_position_rad": low + middle + high, "position_command_m": low + 1.25 * middle + 0.9 * high}
    lead = lead_of(Recording("joint", columns, 1e-3), None)
    assert lead.value == pytest.approx(2.0 * np.pi)
    assert lead.std_error > 0.01 * lead.value


@pytest.mark.parametrize(("off", "lead"), [(0.5e-4, 0.15), (5e-4, 0.15 * (1.0 + 5e-4))])
def test_the_lead_of_the_map_stands_where_the_measured_one_does_not_contradict_it(off: float, lead: float) -> None:
    angle = 100.0 * np.sin(np.arange(4000) * 1e-3)
    columns = {"motor_position_rad": angle, "position_command_m": 0.15 * (1.0 + off) * angle / (2.0 * np.pi)}
    found = lead_of(Recording("belt", columns, 1e-3, {"lead_m": 0.15}), None)
    assert found.value == pytest.approx(lead, rel=1e-6)


def test_a_map_without_a_lead_leaves_the_measured_one() -> None:
    angle = 100.0 * np.sin(np.arange(4000) * 1e-3)
    columns = {"motor_position_rad": angle, "position_command_m": 0.0123 * angle / (2.0 * np.pi)}
    found = lead_of(Recording("belt", columns, 1e-3, {"lead_m": None}), None)
    assert found.value == pytest.approx(0.0123, rel=1e-6)


def test_a_gear_follows_from_two_angles(tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "motor_angle_rad": AXIS["angle"], "load_angle_rad": AXIS["angle"] / 50.0}
    bench = load_bench(drafted(tmp_path, columns | {"torque_Nm": AXIS["torque"]}))
    assert bench.axis.model == "rotary"
    assert bench.axis.gear_ratio == 50.0  # the whole number that the measured ratio is within 1e-4 of
    assert bench.axis.inertia_kg_m2 == pytest.approx(INERTIA_KG_M2, rel=0.02)


def test_a_late_second_encoder_is_said(tmp_path: Path) -> None:
    late = np.interp(AXIS["t"] - 0.003, AXIS["t"], AXIS["x_act"])
    draft = draft_bench(_recording(AXIS | {"x_act": late}))
    note = next(note for note in draft.notes if "late" in note)
    assert float(note.split(" by ")[1].split(" ms")[0]) == pytest.approx(3.0, rel=0.05)
    assert tmp_path.exists()


def test_the_step_of_a_quantised_channel_is_found_and_none_in_a_smooth_one() -> None:
    smooth = np.cumsum(np.random.default_rng(5).normal(size=5000))
    assert count_of(smooth) is None
    assert count_of(np.round(smooth / 0.037) * 0.037) == pytest.approx(0.037, rel=1e-6)
    steady = 9.0 * np.arange(600) + np.random.default_rng(6).normal(0.0, 0.02, 600)  # of which each row is one step
    assert count_of(np.round(steady / 0.01) * 0.01) == pytest.approx(0.01, rel=1e-3)
    assert count_of(steady) is None
    assert count_of(np.arange(600) * np.float32(1e-3)) == pytest.approx(1e-3, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"torque": -AXIS["torque"]}, "wrong sign"),
        ({"angle": np.cos(np.pi * AXIS["t"] / 1e-3)}, "keeps sliding one way"),
        ({"torque": None, "x_act": None}, "not recorded"),
    ],
)
def test_what_cannot_be_told_is_refused(change: dict[str, np.ndarray | None], says: str) -> None:
    with pytest.raises(InputError, match=says):
        draft_bench(_recording({name: values for name, values in (AXIS | change).items() if values is not None}))


def test_a_bench_file_is_not_overwritten(tmp_path: Path) -> None:
    target = tmp_path / "axis.yaml"
    target.write_text("mine")
    with pytest.raises(InputError, match="not overwritten"):
        identify([CLEAN], target)
    assert target.read_text() == "mine"


def test_the_text_is_a_bench_file_with_comments() -> None:
    text = bench_text(draft_bench(_recording(AXIS)))
    assert text.startswith("# Bench of log")
    assert "control: unknown   # " in text


def _recording(columns: dict[str, np.ndarray]) -> Recording:
    names = {"t": "time_s", "angle": "motor_position_rad", "x_act": "table_position_m", "torque": "torque_n_m"}
    channels = {names[name]: values for name, values in columns.items() if name in names}
    if "table_position_m" in channels:
        channels["table_position_m"] = 1e-3 * channels["table_position_m"]
    return Recording("log", channels, 1e-3)


def test_a_load_over_the_angle_is_said() -> None:
    angle = AXIS["angle"] / 20.0
    torque = AXIS["torque"] + 0.5 * np.sin(angle)
    plain, loaded = (
        draft_bench(Recording("log", {"time_s": AXIS["t"], "motor_position_rad": angle, "torque_n_m": one}, 1e-3))
        for one in (AXIS["torque"], torque)
    )
    assert not any("gravity" in note for note in plain.unsure)
    assert any("gravity" in note for note in loaded.unsure)
    note = next(note for note in loaded.notes if "(gravity)" in note)
    assert float(note.split("(gravity) ")[1].split(" N m")[0]) == pytest.approx(0.5, rel=0.05)


def test_a_spring_is_said_and_does_not_turn_the_inertia() -> None:
    columns = {"time_s": AXIS["t"], "motor_position_m": 0.01 * AXIS["angle"], "force_n": 100.0 * AXIS["torque"]}
    loaded = columns | {"force_n": columns["force_n"] + 2e3 * columns["motor_position_m"]}
    without, draft = (draft_bench(Recording("log", one, 1e-3)) for one in (columns, loaded))
    note = next(note for note in draft.notes if "(a spring)" in note)
    assert float(note.split("(a spring) ")[1].split(" N/m")[0]) == pytest.approx(2e3, rel=0.05)
    assert draft.axis.values[0].key == "mass_kg"
    assert draft.axis.values[0].value == pytest.approx(without.axis.values[0].value, rel=0.05)


def joint(gear: float, stiffness: float, play_rad: float) -> dict[str, np.ndarray]:
    """A joint under gravity: its link lags by deflection and play; the torque carries weight, inertia and friction."""
    random, t = np.random.default_rng(2), np.arange(20_000) / 500.0
    load = 0.6 * np.sin(0.5 * t) + 0.3 * np.sin(1.7 * t + 1.0)
    speed = 0.3 * np.cos(0.5 * t) + 0.51 * np.cos(1.7 * t + 1.0)
    acceleration = -0.15 * np.sin(0.5 * t) - 0.867 * np.sin(1.7 * t + 1.0)
    weight = 30.0 * np.sin(load)
    torque = (weight + 0.5 * acceleration + 4.0 * np.sign(speed)) / gear
    motor = gear * (load + weight / stiffness + 0.5 * play_rad * np.sign(weight))
    return {
        "time_s": t,
        "motor_angle_rad": motor + random.normal(0.0, 2e-5, t.size),
        "link_angle_rad": np.round(load / 1e-6) * 1e-6,
        "motor_torque_Nm": torque + random.normal(0.0, 0.003, t.size),
    }


def test_the_ratio_of_a_joint_under_gravity_leaves_out_its_deflection(tmp_path: Path) -> None:
    bench = load_bench(drafted(tmp_path, joint(50.0, 9e3, 4e-4)))
    assert bench.axis.model == "rotary_two_mass"
    assert bench.axis.gear_ratio == pytest.approx(50.0, rel=1e-5)
    assert bench.axis.stiffness_n_m_rad == pytest.approx(9e3, rel=0.15)
    (entry,) = bench.mechanisms
    assert entry.parameters["gravity_torque_n_m"] == pytest.approx(30.0, rel=0.02)


def test_two_encoders_without_a_torque_make_a_bench_of_the_transmission(tmp_path: Path) -> None:
    path = drafted(tmp_path, {name: values for name, values in SCREW.items() if name != "torque_Nm"})
    bench = load_bench(path)
    assert bench.axis.model == "rigid"
    assert bench.axis.lead_m == pytest.approx(LEAD_M, rel=1e-4)
    assert "no torque is recorded" in path.read_text()


def test_a_recording_at_20_khz_tells_its_inertia(tmp_path: Path) -> None:
    fast = renamed(axis(rows=60_000, rate_hz=20_000.0), t="time_s", angle="motor_angle_rad", torque="torque_Nm")
    bench = load_bench(drafted(tmp_path, fast))
    assert bench.axis.inertia_kg_m2 == pytest.approx(INERTIA_KG_M2, rel=0.05)


@pytest.mark.parametrize(
    ("measured", "error", "gear"),
    [
        (79.998, 0.003, 80.0),
        (79.998, 0.0005, 80.0),
        (4583.62, 0.05, 4583.62),
        (79.9, 0.003, 79.9),
        (0.98, 0.02, 1.0),
        (0.9, 0.06, 0.9),
    ],
)
def test_a_gear_is_rounded_only_to_a_whole_number_that_is_near(measured: float, error: float, gear: float) -> None:
    lead = 2.0 * np.pi / measured
    assert gear_of(Estimate(lead, lead / measured * error)).value == pytest.approx(gear, rel=1e-9)


def test_several_recordings_are_one_axis_and_short_ones_are_no_obstacle(tmp_path: Path) -> None:
    """Each way alone in its file, and a file of ten rows."""
    files = []
    for number, (way, rows) in enumerate(((1.0, 4000), (-1.0, 4000), (1.0, 10))):
        time = np.arange(rows) * 1e-3
        velocity, acceleration = way * (6.0 + 3.0 * np.sin(5.0 * time)), way * 15.0 * np.cos(5.0 * time)
        torque = 0.02 * acceleration + 0.05 * velocity + way * 0.8 + 0.1
        columns = {"time_s": time, "motor_position_rad": np.cumsum(velocity) * 1e-3, "torque_n_m": torque}
        files.append(tmp_path / f"part{number}.parquet")
        write_parquet(Recording(f"part{number}", columns, 1e-3), files[-1])
    identify(files, tmp_path / "axis.yaml")
    bench = load_bench(tmp_path / "axis.yaml")
    assert bench.axis.inertia_kg_m2 == pytest.approx(0.02, rel=0.02)
    assert bench.axis.coulomb_torque_n_m == pytest.approx(0.8, rel=0.02)
    assert "3 parts together" in (tmp_path / "axis.yaml").read_text()


def test_a_draft_that_is_no_valid_bench_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "hil.drafting.drafted_bench.bench_text", lambda draft: "schema_version: 1\naxis:\n  model: rotary\n"
    )
    write_parquet(_recording(AXIS), tmp_path / "log.parquet")
    with pytest.raises(InputError, match="no valid bench"):
        identify([tmp_path / "log.parquet"], tmp_path / "axis.yaml")
    assert not (tmp_path / "axis.yaml").exists()


@pytest.mark.parametrize("header", ["", "# Lead: 10 mm\n"])
def test_the_lead_makes_a_screw_of_the_channels_of_the_motor_alone(tmp_path: Path, header: str) -> None:
    source, target = tmp_path / "log.csv", tmp_path / "log.parquet"
    write(source, renamed(AXIS, t="time_s", angle="motor_angle_rad", torque="torque_Nm"))
    source.write_text(header + source.read_text())
    import_(source, None, target, None, None)
    if not header:  # the owner writes the lead into the map
        path = tmp_path / "log-map.yaml"
        mended = re.sub(r"^lead_m: 6\.28\S+", "lead_m: 0.010", path.read_text(), flags=re.MULTILINE)
        assert mended != path.read_text()
        path.write_text(mended)
        target = tmp_path / "screw.parquet"
        import_(source, str(path), target, None, None)
    identify([target], tmp_path / "axis.yaml")
    bench = load_bench(tmp_path / "axis.yaml")
    assert bench.axis.model == "rigid"
    assert bench.axis.lead_m == LEAD_M
    assert bench.axis.mass_kg == pytest.approx(INERTIA_KG_M2 * (2 * np.pi / LEAD_M) ** 2, rel=0.01)
    assert "lead of the map" in (tmp_path / "axis.yaml").read_text()
