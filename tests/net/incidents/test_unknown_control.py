"""Without a control law the plant alone is judged, from the channels that there are; the rest is listed as untold."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import SEGMENTS, bench, changed, recorded
from scipy.interpolate import CubicSpline

from hil.bench.bench_file import Bench, load_bench
from hil.bench.control_section import UnknownControl
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.result import Result
from hil.diagnosis.search.next_term import Round, next_term
from hil.diagnosis.search.score_test import Candidate
from hil.errors import InputError
from hil.identification.compare import compare
from hil.identification.derived_channels import completed
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.report.diagnosis_report import write_diagnosis

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
    [{}, SET_POINTS, SET_POINTS | {"torque_command_n_m": None}, SET_POINTS | {"torque_n_m": None}],
    ids=["all channels", "no set-points", "torque alone", "command alone"],
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


def test_the_measured_motion_tells_rest_from_motion() -> None:
    recording = laps()
    found = completed(changed(recording, **SET_POINTS), OWNER)
    still = recording["velocity_command_m_s"] == 0.0
    assert np.mean(found["velocity_command_m_s"][still] == 0.0) > 0.8
    assert np.mean(found["velocity_command_m_s"][~still] != 0.0) > 0.95
    assert completed(recording, KNOWN) is recording
    assert SEGMENTS[0]["kind"] == "dwell"
    assert np.all(found["velocity_command_m_s"][:100] == 0.0)


def test_motion_alone_is_refused() -> None:
    alone = changed(laps(), **SET_POINTS, torque_n_m=None, torque_command_n_m=None, table_position_m=None)
    with pytest.raises(InputError, match="motion alone has no cause; record one"):
        answer(alone)


def test_a_known_law_is_set_aside_without_set_points() -> None:
    result = answer(changed(laps(COGGING), **SET_POINTS), KNOWN)
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert any("position_command_m, velocity_command_m_s are not recorded" in note for note in result.notes)


@pytest.mark.parametrize(
    "control", ["", "control: unknown\n", "control: {position_gain_1_s: 36.84, velocity_gain_n_m_s_rad: unknown}\n"]
)
def test_a_bench_file_says_what_is_unknown(tmp_path: Path, control: str) -> None:
    path = tmp_path / "axis.yaml"
    axis = (
        "model: rigid\n  mass_kg: 700.0\n  lead_m: 0.01\n  coulomb_torque_n_m: 1.0\n  viscous_torque_n_m_s_rad: 0.006\n"
    )
    path.write_text(f"axis:\n  {axis}{control}encoders: {{table: null}}\n")
    found = load_bench(path)
    assert not found.law_known
    assert found.sampled(0.002).gains.period_s == 0.002
    assert not compare(laps(), found).channels  # block by block only


def test_a_mistyped_key_beside_an_unknown_value_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "axis.yaml"
    path.write_text(
        "lead_m: 0.01\nmass_kg: 700.0\ncoulomb_torque_n_m: 1.0\nviscous_torque_n_m_s_rad: 0.006\n"
        "control:\n  position_gain_1_s: unknown\n  torque_limit: 12\n"
    )
    with pytest.raises(InputError, match=r"axis\.yaml:7: control\.torque_limit: given an unknown key"):
        load_bench(path)


def test_the_noise_of_a_sampled_torque_is_no_evidence() -> None:
    """An axis without any effect whose torque was only measured: a delay of half a row would average its noise."""
    recording = changed(recorded(KNOWN, times=2, torque_noise_n_m=0.05), torque_command_n_m=None)
    recording = replace(recording, metadata={**recording.metadata, "source": "log.csv"})
    found = fit_nominal_parameters(prepare([recording], [], OWNER).train)
    delay_s = found.hypothesis.values[found.hypothesis.nominal.index("torque_delay_s")]
    assert abs(delay_s) < 0.1 * recording.period_s
    candidates = [Candidate(COGGING, 0.9)]
    additions = next_term(Round(found, found, found), candidates, print)
    assert (additions.fits, additions.best) == ([], None)
