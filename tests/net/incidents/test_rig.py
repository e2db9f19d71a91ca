"""The rig recordings, whose cause is known: read, compared, and diagnosed from the files to the report."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from matplotlib.image import imread
from measured_recordings import rig

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.result import schema
from hil.identification.compare import compare
from hil.identification.dataset import prepare_dataset
from hil.identification.friction import identify_friction
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal
from hil.recording.recording import Recording, read_recording
from hil.report.diagnosis_report import write_diagnosis
from hil.twin.library import BY_ID
from hil.validation.proof.draw.less_known import forget

pytestmark = pytest.mark.net

# As the README of the recordings has it
TRUTH: dict[str, tuple[str, dict[str, float]]] = {
    "stribeck": ("stribeck_friction", {"static_torque_n_m": 1.708, "stribeck_velocity_rad_s": 3.085}),
    "backlash": ("backlash", {"gap_m": 24.74e-6}),
    "lead": ("periodic_lead_error", {"amplitude_m": 5.858e-6, "phase_rad": 1.532}),
}
EFFECTS = list(TRUTH)


@cache
def diagnosed(folder: str) -> Diagnosis:
    """The diagnosis of a folder, made once."""
    path = rig(folder)
    train = [read_recording(path / f"train_{number}.csv") for number in (1, 2)]
    return diagnose(train, [read_recording(path / "holdout.csv")], load_bench(path.parent / "axis.yaml"))


@pytest.mark.parametrize("folder", EFFECTS)
def test_the_effect_is_named_first_with_its_parameters(folder: str) -> None:
    effect, parameters = TRUTH[folder]
    result = diagnosed(folder).result
    assert result.verdict == "missing_physics"
    assert [finding.effect for finding in result.missing] == [effect]
    found = result.missing[0]
    assert {name: found.parameters[name].value for name in parameters} == pytest.approx(parameters, rel=0.05)
    assert found.confidence > 0.9
    assert result.location is not None
    assert result.location.block == BY_ID[effect].block


@pytest.mark.parametrize("folder", EFFECTS)
def test_it_explains_the_held_out_recording(folder: str) -> None:
    result = diagnosed(folder).result
    for channel, entry in result.fit.items():
        assert entry.validate_ is not None
        assert entry.validate_.after_rms < 1.15 * entry.validate_.noise_floor_rms, channel
        assert entry.validate_.after_rms < 0.3 * entry.validate_.before_rms, channel
    assert result.unexplained.share < 0.01


def test_where_no_physics_is_missing_none_is_named() -> None:
    result = diagnosed("null").result
    assert result.verdict == "parameter_error"
    assert result.missing == ()
    correction = result.parameter_corrections["coulomb_torque_n_m"]
    assert correction.nominal == 1.1
    assert abs(correction.value - 1.1) > 10.0 * correction.std
    for channel, entry in result.fit.items():
        assert entry.validate_ is not None
        assert entry.validate_.after_rms < 1.15 * entry.validate_.noise_floor_rms, channel
    assert result.unexplained.share < 0.01


@pytest.mark.parametrize("folder", ["null", *EFFECTS])
def test_the_report_is_whole(folder: str, tmp_path: Path) -> None:
    diagnosis = diagnosed(folder)
    write_diagnosis(diagnosis, tmp_path)
    data: dict[str, Any] = json.loads((tmp_path / "diagnosis.json").read_text())
    jsonschema.validate(data, schema())
    page = (tmp_path / "report.html").read_text()
    assert diagnosis.result.statement[:40] in page
    for picture in ["location", "residuals", *(finding.effect for finding in diagnosis.result.missing)]:
        assert imread(tmp_path / f"{picture}.png").std() > 0.05, picture


@pytest.mark.parametrize("folder", ["null", *EFFECTS])
def test_the_diagnosed_bench_is_a_bench_and_explains(folder: str, tmp_path: Path) -> None:
    """It is read back, and its twin leaves what `fit` says in closed loop."""
    diagnosis = diagnosed(folder)
    write_diagnosis(diagnosis, tmp_path)
    bench = load_bench(tmp_path / "bench.diagnosed.yaml")
    assert {entry.effect for entry in bench.mechanisms} == {finding.effect for finding in diagnosis.result.missing}
    run = take(read_recording(rig(folder) / "holdout.csv"), bench)
    answer = bench.twin().simulate(run.position_command_m, run.velocity_command_m_s, run.start, run.table_m)
    left = (run.torque - answer.torque)[run.evaluated]
    entry = diagnosis.result.fit["torque_n_m"]
    assert entry.validate_ is not None
    if entry.mode == "closed_loop":
        assert float((left**2).mean() ** 0.5) == pytest.approx(entry.validate_.after_rms, rel=0.02)


def test_a_lead_error_is_told_from_an_eccentric_encoder_by_its_reaction_on_the_motor() -> None:
    """Without the linear encoder: the table's inertia alone reacts to a lead error, the whole axis to an encoder's."""
    path = rig("lead")
    runs = [read_recording(path / f"{name}.csv") for name in ("train_1", "train_2", "holdout")]
    one, bench = forget("one encoder", runs, load_bench(path.parent / "axis.yaml"), np.random.default_rng(0))
    (found,) = diagnose(one[:2], one[2:], bench).result.missing
    assert found.effect == "periodic_lead_error"
    assert found.parameters["amplitude_m"].value == pytest.approx(5.858e-6, rel=0.02)


def compared(name: str) -> tuple[Bench, Recording]:
    folder, file = name.split("/")
    return load_bench(rig(folder).parent / "axis.yaml"), read_recording(rig(folder) / file)


def test_the_null_rig_is_explained_on_another_motion() -> None:
    bench, holdout = compared("null/holdout.csv")
    trained = [take(compared(f"null/{name}.csv")[1], bench) for name in ("train_1", "train_2")]
    result = compare(holdout, fit_nominal(prepare_dataset(trained, bench)).bench)
    assert result.torque_over_noise <= 1.3
    assert result.channel("table_position_m").rms <= 1e-6
    assert result.explained


@pytest.mark.parametrize(
    ("folder", "block"),
    [("stribeck", "motor and load"), ("lead", "transmission and table"), ("backlash", "transmission and table")],
)
def test_the_other_rigs_are_not_explained_by_parameters(folder: str, block: str) -> None:
    bench, recording = compared(f"{folder}/holdout.csv")
    result = compare(recording, bench, fit=True)
    assert not result.explained
    over: dict[str, Any] = {
        part.deviation.name: part.deviation.rms / part.noise for part in result.blocks if part.noise > 0.0
    }
    assert over[block] > 3.0
    assert over["drive"] < 1.1


def test_the_rig_with_a_stribeck_fall_gives_its_coulomb_torque_above_it() -> None:
    recording = read_recording(rig("stribeck") / "train_1.csv")
    # Coulomb 1.007 N m is in the data; below some 6 rad/s the Stribeck fall (3.085 rad/s) lifts the points
    assert identify_friction(recording, speed_min=6.0).coulomb == pytest.approx(1.007, rel=0.01)
    assert identify_friction(recording).coulomb > 1.1


def test_the_rig_recordings_are_read() -> None:
    recording = read_recording(rig("null") / "train_1.csv")
    assert len(recording) == 20529
    assert recording.period_s == 0.001
    assert recording["motor_position_rad"][-1] == 125.66370614
    assert "unknown_columns" not in recording.metadata
