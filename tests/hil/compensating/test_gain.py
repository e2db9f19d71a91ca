"""The gain of a compensation on simulated axes whose effects are concealed: before, predicted, measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import hil as command
from compensated_benches import EFFECTS, bench_of_effects, diagnosed, there_and_back

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.compensating.compensate import Plan, plan_compensation, section_of
from hil.compensating.prediction import Errors, predict
from hil.control.compensation_tables import OFF, Adds
from hil.diagnosis.result import Correction, Finding, Result, Value
from hil.recording.recording import Recording
from hil.report.compare_report import write_bench

FADE_S = 0.3


def measured(run: Recording, ratio: float) -> Errors:
    first, added = round(FADE_S * 1e3), run.columns.get("compensation_position_m", np.zeros(len(run)))
    following = (run["position_command_m"] + added - ratio * run["motor_position_rad"])[first:]
    place = (run["table_position_m"] - run["position_command_m"])[first:]
    return Errors(float(np.sqrt(np.mean(following**2))), float(np.std(place)))


@pytest.fixture(scope="module")
def made() -> Plan:
    bench = diagnosed()
    return plan_compensation(bench, there_and_back(bench, 0.1, 0.1), None, FADE_S)


def test_errors_fall_as_predicted_on_a_motion_that_no_table_was_made_on(
    made: Plan, capsys: pytest.CaptureFixture[str]
) -> None:
    section = section_of(made, Path("bench.diagnosed.yaml"), "2026-01-31")
    plain, compensated = bench_of_effects(), bench_of_effects(compensation=section)
    motion = there_and_back(plain, 0.063, 0.02)
    ratio = plain.axis.ratio_m_rad
    before, after = (measured(hil.simulate(one, motion, seed=5), ratio) for one in (plain, compensated))
    tables = compensated.tables()
    told_before, told = (predict(diagnosed(), motion, one, FADE_S) for one in (OFF, tables))
    with capsys.disabled():
        for name, index in (("following", 0), ("positioning", 1)):
            figures = [1e6 * one[index] for one in (before, told_before, told, after)]
            print(
                "\n{}: before {:.2f}, predicted {:.2f} -> {:.2f}, measured after {:.2f} µm rms".format(name, *figures)
            )
    for index in (0, 1):
        assert after[index] < 0.6 * before[index]
        assert told[index] == pytest.approx(after[index], rel=0.35)


def test_every_effect_has_its_table(made: Plan) -> None:
    sources = {effect for effects in made.derived.sources.values() for effect in effects}
    assert sources == {"axis", "cogging_torque", "periodic_lead_error", "backlash", "table_side_friction"}
    assert not made.derived.left_out


def test_a_position_loop_on_the_table_needs_no_position_table() -> None:
    data = diagnosed().model_dump(mode="json")
    data["control"]["position_feedback"] = "table"
    bench = Bench.model_validate(data)
    found = plan_compensation(bench, there_and_back(bench, 0.05, 0.1), None, FADE_S).derived
    assert {table.adds.value for table in found.compensation.tables} == {"torque"}
    assert ("periodic_lead_error", "the position loop sees the table and corrects it") in found.left_out


def _write_motion(folder: Path) -> None:
    profile = {"schema_version": 1, "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": 2.5, "jerk_m_s3": 120}}
    profile["segments"] = [  # type: ignore[assignment]
        {"kind": "dwell", "duration_s": 0.5},
        {"kind": "sine_squared", "to_m": 0.05, "feed_m_s": 0.1},
        {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.1},
    ]
    (folder / "move.yaml").write_text(yaml.safe_dump(profile), encoding="utf-8")


def test_a_drive_in_csp_gets_the_tables_of_the_position_only(tmp_path: Path) -> None:
    drive = diagnosed().model_dump(mode="json")["drive"] | {"mode": "csp", "rated_torque_n_m": 5.0}
    write_bench(
        Bench.model_validate(diagnosed().model_dump(mode="json") | {"drive": drive}), tmp_path / "bench.diagnosed.yaml"
    )
    _write_motion(tmp_path)
    ran = command(tmp_path, "compensate", ".", "--profile", "move.yaml", "--fade-in", "0.3", "--for", "cia402")
    assert ran.returncode == 0, ran.stderr
    assert "Not in the bench file: inertia: a torque is added to the command of a drive in cst only" in ran.stdout
    written = load_bench(tmp_path / "bench.compensated.yaml")
    assert {entry.adds for entry in written.compensation.entries} == {Adds.POSITION}  # type: ignore[union-attr]


def test_the_command_writes_a_bench_and_refuses_to_overwrite_it(tmp_path: Path) -> None:
    bench = diagnosed()
    late = {"effect": "transport_delay", "parameters": {"delay_s": 0.0005}}
    write_bench(
        Bench.model_validate(bench.model_dump(mode="json") | {"mechanisms": [late]}), tmp_path / "bench.diagnosed.yaml"
    )
    _write_motion(tmp_path)
    arguments = ("compensate", ".", "--profile", "move.yaml", "--fade-in", "0.3")
    ran = command(tmp_path, *arguments)
    assert ran.returncode == 0, ran.stderr
    assert "Not compensated: transport_delay: a delay or limit of the torque" in ran.stdout
    written = load_bench(tmp_path / "bench.compensated.yaml")
    assert [entry.name for entry in written.compensation.entries] == ["inertia", "friction and load"]  # type: ignore[union-attr]
    assert command(tmp_path, *arguments).returncode == 2


def _lead_error_found(phase_error_rad: float) -> Result:
    """What the prediction reads of a diagnosis: the standard errors of a finding and of a mass."""
    values = EFFECTS["periodic_lead_error"]
    errors = {"amplitude_m": 1e-7, "phase_rad": phase_error_rad}
    parameters = {name: Value(value=value, std=errors[name], unit="") for name, value in values.items()}
    finding = Finding(effect="periodic_lead_error", confidence=1.0, parameters=parameters, sentence="")
    mass = Correction(value=384.0, std=2.0, unit="kg", nominal=380.0)
    return Result.model_construct(missing=(finding,), partial=(), parameter_corrections={"table_mass_kg": mass})


@pytest.mark.parametrize(("phase_error_rad", "harms"), [(0.02, False), (2.0, True)])
def test_parameters_that_are_not_known_give_no_compensation(phase_error_rad: float, harms: bool) -> None:
    bench = load_bench("reference")
    entry = {"effect": "periodic_lead_error", "parameters": EFFECTS["periodic_lead_error"]}
    bench = Bench.model_validate(bench.model_dump(mode="json") | {"mechanisms": [entry]})
    made = plan_compensation(bench, there_and_back(bench, 0.03, 0.01), _lead_error_found(phase_error_rad), FADE_S)
    low, high = made.gain.interval(Adds.POSITION)
    assert low < 1.0
    assert (high >= 1.0) is harms
    assert [text for text in made.harms if "positioning" in text] != [] if harms else made.harms == []
    # A sin(a + p): the largest standard error of a value is A times that of the phase
    assert made.errors["set-point over angle"] == pytest.approx(8e-6 * phase_error_rad, rel=0.7)
    assert made.errors["inertia"] > 0.0
