"""One diagnosis of each kind, from the recording to the report; regressions of incidents are in tests/net/incidents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from axis_change import assert_change_is_told
from diagnosis_runs import bench, changed, recorded

from hil.bench.bench_file import Bench, load_bench
from hil.bench.control_section import UnknownControl
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.result import Result
from hil.errors import InputError
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.report.diagnosis_report import write_diagnosis

OWNER = bench()
LAW = OWNER.known_control
COGGING = Term("cogging_torque", 0, (0.2, 6.0, 0.4))
_, _, VELOCITY_GAIN, INTEGRAL_TIME = LAW.gain_names
WRONG = {"position_gain_1_s": 0.4, "velocity_feedforward": 1.7, VELOCITY_GAIN: 2.5, INTEGRAL_TIME: 0.5}


def laps(*terms: Term) -> Recording:
    return recorded(OWNER, *terms, times=4)


def believed(**factors: float) -> Bench:
    values = {name: factor * getattr(LAW, name) for name, factor in factors.items()}
    return OWNER.model_copy(update={"control": LAW.model_copy(update=values)})


def answer(recording: Recording, owner: Bench) -> Result:
    return diagnose([recording], [], owner).result


AMPLITUDE_N_M = 0.3


def with_bursts(run: Recording) -> Recording:
    """The recording with bursts of noise on its linear encoder, which no mechanism of the library describes."""
    rng = np.random.default_rng(3)
    table_m = run["table_position_m"].copy()
    for start in range(400, table_m.size - 100, 700):
        table_m[start : start + 60] += 3e-6 * rng.standard_normal(60)
    return changed(run, table_position_m=table_m)


@pytest.mark.long
def test_the_part_that_is_explained_is_told(tmp_path: Path) -> None:
    cogging = Term("cogging_torque", 0, (AMPLITUDE_N_M, 6.0, 0.4))
    train, held_out = (with_bursts(recorded(OWNER, cogging, seed=seed, name=f"run_{seed}")) for seed in (1, 2))
    found = diagnose([train], [held_out], OWNER)
    result = found.result
    assert result.verdict == "unexplained"
    assert not result.missing
    (part,) = result.partial
    assert part.effect == "cogging_torque"
    assert part.parameters["amplitude_n_m"].value == pytest.approx(AMPLITUDE_N_M, rel=0.02)
    assert 0.02 < result.unexplained.share < 0.5
    assert "table position" in result.unexplained.description
    write_diagnosis(found, tmp_path)
    assert "Explains a part: cogging torque" in (tmp_path / "report.html").read_text()
    assert [entry.effect for entry in load_bench(tmp_path / "bench.diagnosed.yaml").mechanisms] == ["cogging_torque"]


@pytest.mark.long
def test_wrong_gains_are_settings_of_the_controller_and_no_physics() -> None:
    result = answer(laps(), believed(**WRONG))
    assert result.verdict == "parameter_error"
    assert not result.missing
    assert {VELOCITY_GAIN, "position_gain_1_s"} <= set(result.parameter_corrections)
    assert result.parameter_corrections[VELOCITY_GAIN].value == pytest.approx(getattr(LAW, VELOCITY_GAIN), rel=2e-3)
    assert result.location is not None
    assert result.location.block == "controller"
    assert any("Check the controller's settings" in note for note in result.notes)


@pytest.mark.long
def test_a_cause_is_named_beside_wrong_gains() -> None:
    result = answer(laps(COGGING), believed(**WRONG))
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert VELOCITY_GAIN in result.parameter_corrections


@pytest.mark.long
def test_positions_coarser_than_those_of_the_loop_are_no_mismatch() -> None:
    recording = laps()
    step_rad = 100.0 * OWNER.motor_count
    coarse = np.round(recording["motor_position_rad"] / step_rad) * step_rad
    assert answer(changed(recording, motor_position_rad=coarse), OWNER).verdict == "no_mismatch"


SET_POINTS = {"position_command_m": None, "velocity_command_m_s": None}


@pytest.mark.long
def test_without_a_control_law_a_cause_is_named_from_the_torque(tmp_path: Path) -> None:
    recording = changed(laps(COGGING), **SET_POINTS, torque_command_n_m=None)
    found = diagnose([recording], [], OWNER.model_copy(update={"control": UnknownControl(law="unknown")}))
    result = found.result
    assert [finding.effect for finding in result.missing] == ["cogging_torque"]
    assert result.missing[0].parameters["amplitude_n_m"].value == pytest.approx(0.2, rel=0.05)
    assert {entry.mode for entry in result.fit.values()} == {"blocks"}
    assert "velocity_filter_lag" in result.not_testable
    assert any("control law is unknown" in note for note in result.notes)
    assert result.next_experiment is None
    write_diagnosis(found, tmp_path)
    again = load_bench(tmp_path / "bench.diagnosed.yaml")
    assert not again.law_known
    assert "cogging_torque" in {entry.effect for entry in again.mechanisms}


def test_motion_alone_is_refused() -> None:
    alone = changed(laps(), **SET_POINTS, torque_n_m=None, torque_command_n_m=None, table_position_m=None)
    with pytest.raises(InputError, match="motion alone has no cause; record one"):
        answer(alone, OWNER.model_copy(update={"control": UnknownControl(law="unknown")}))


@pytest.mark.long
def test_a_push_is_named_with_its_window() -> None:
    push = Term("external_force", 0, (400.0, 0.55, 0.75))
    (finding,) = answer(recorded(OWNER, push, times=4), OWNER).missing
    assert finding.effect == "external_force"
    (window,) = finding.windows
    assert (window.start.value, window.end.value) == pytest.approx((0.55, 0.75), abs=5e-3)
    assert window.strength.value == pytest.approx(400.0, rel=0.02)


@pytest.mark.long
def test_the_moment_at_which_the_inertia_changes_is_said(tmp_path: Path) -> None:
    assert_change_is_told(tmp_path, 4000)  # in the training part
