"""Without a control law the plant alone is judged, from the channels that there are; the rest is listed as untold."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded
from scipy.interpolate import CubicSpline

from hil.bench.bench_file import Bench, load_bench
from hil.bench.control_section import UnknownControl
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.result import Result
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.report.diagnosis_report import write_diagnosis

pytestmark = pytest.mark.net

KNOWN = bench()
OWNER = KNOWN.model_copy(update={"control": UnknownControl(law="unknown")})
GAP_M = 20e-6
BACKLASH = Term("backlash", 0, (GAP_M,))
COGGING = Term("cogging_torque", 0, (0.2, 6.0, 0.4))
SET_POINTS = {"position_command_m": None, "velocity_command_m_s": None}


def answer(recording: Recording, owner: Bench = OWNER, folder: Path | None = None) -> Result:
    diagnosis = diagnose([recording], [], owner)
    if folder is not None:
        write_diagnosis(diagnosis, folder)
    return diagnosis.result


def laps(*terms: Term) -> Recording:
    return recorded(KNOWN, *terms, times=4)


@pytest.mark.parametrize(
    "left_out",
    [{}, SET_POINTS, SET_POINTS | {"torque_n_m": None}],
    ids=["all channels", "no set-points", "command alone"],
)
def test_a_cause_is_named_as_with_the_controller(left_out: dict[str, None], tmp_path: Path) -> None:
    result = answer(changed(laps(COGGING), **left_out), folder=tmp_path)
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert result.missing[0].parameters["amplitude_n_m"].value == pytest.approx(0.2, rel=0.05)
    assert {entry.mode for entry in result.fit.values()} == {"blocks"}
    assert "velocity_filter_lag" in result.not_testable
    assert any("control law is unknown" in note for note in result.notes)
    assert result.next_experiment is None
    again = load_bench(tmp_path / "bench.diagnosed.yaml")
    assert not again.law_known
    assert "cogging_torque" in {entry.effect for entry in again.mechanisms}


def test_two_encoders_without_a_torque_tell_the_transmission(tmp_path: Path) -> None:
    silent = SET_POINTS | {"torque_n_m": None, "torque_command_n_m": None}
    result = answer(changed(laps(BACKLASH), **silent), folder=tmp_path)
    assert [finding.effect for finding in result.missing] == ["backlash"]
    assert result.missing[0].parameters["gap_m"].value == pytest.approx(GAP_M, rel=0.05)
    assert set(result.fit) == {"table_position_m"}
    # motion alone tells no mass, stiffness or friction; the damping may end at its bound, where it is no correction
    assert set(result.parameter_corrections) <= {"damping_ratio"}
    assert {"stribeck_friction", "cogging_torque", "current_loop_lag"} <= set(result.not_testable)
    assert any("record torque_n_m or torque_command_n_m" in note for note in result.notes)
    assert "No torque is recorded" in (tmp_path / "report.html").read_text()
    assert json.loads((tmp_path / "diagnosis.json").read_text())["notes"]


def test_one_encoder_hides_the_transmission_and_says_so() -> None:
    result = answer(changed(laps(COGGING), **SET_POINTS, table_position_m=None))
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert "backlash" in result.not_testable
    assert any("and table_position_m" in note for note in result.notes)


@pytest.mark.parametrize("noise_rad_s", [0.0, 0.02])
def test_a_velocity_takes_the_place_of_the_position(noise_rad_s: float) -> None:
    recording = laps(COGGING)
    speed = CubicSpline(recording["time_s"], recording["motor_position_rad"]).derivative()(recording["time_s"])
    speed += noise_rad_s * np.random.default_rng(5).standard_normal(speed.size)
    found = answer(changed(recording, **SET_POINTS, motor_position_rad=None, motor_velocity_rad_s=speed))
    assert [finding.effect for finding in found.missing] == ["cogging_torque"]
    assert found.missing[0].parameters["amplitude_n_m"].value == pytest.approx(0.2, rel=0.05)


def test_a_known_law_is_set_aside_without_set_points() -> None:
    result = answer(changed(laps(COGGING), **SET_POINTS), KNOWN)
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert any("position_command_m, velocity_command_m_s are not recorded" in note for note in result.notes)
