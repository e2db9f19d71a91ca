"""Verdicts, proof on held-out recordings and findings, of hypotheses that are right, wrong, or short of the truth."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, changed, dataset, evaluated, fitted, recorded, rows_of, searched

from hil.bench.bench_file import Bench
from hil.diagnosis.acceptance import names_stand
from hil.diagnosis.preparation.usable_law import LawCheck
from hil.diagnosis.result import Verdict
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.value import Correction
from hil.diagnosis.verdict.corrections import diagnosed_bench
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.findings import findings, renamed
from hil.diagnosis.verdict.judge import explanation, verdict_on_plant
from hil.diagnosis.verdict.testability import not_testable
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.measured import take
from hil.identification.noise_floor import FLOOR
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.identification.torque_left import mismatch_left

OWNER = bench()
LOAD = Term("constant_load", 0, (0.4,))
PLAY = Term("backlash", 0, (20e-6,))


def runs(*terms: Term, seed: int = 1, **axis: float) -> Dataset:
    return dataset([take(recorded(bench(**axis), *terms, seed=seed), OWNER)], OWNER)


NONE = dataset([], OWNER)


def believed(found: Dataset, *terms: Term, **axis: float) -> Fit:
    """A hypothesis as it stands, nothing fitted."""
    return evaluated(Hypothesis(bench(**axis), terms), found)


def test_a_twin_at_the_noise_has_no_mismatch() -> None:
    found = runs()
    right = believed(found)
    assert verdict_on_plant(right, right, right, runs(seed=2)) is Verdict.NO_MISMATCH


@pytest.mark.parametrize(("damping", "noise_rad"), [(0.02, 2e-4), (0.01, 2e-4), (0.005, 2e-4)])
def test_noise_of_the_motor_encoder_rings_in_the_table_and_is_no_physics(damping: float, noise_rad: float) -> None:
    truth = bench(damping_ratio=damping)
    recording = recorded(truth)
    noise = np.random.default_rng(3).normal(0.0, noise_rad, len(recording))
    run = take(changed(recording, motor_position_rad=recording["motor_position_rad"] + noise), truth)
    data = dataset([run], truth, observer_s=0.002)
    right = evaluated(Hypothesis(truth), data)
    table = right.residuals.parts[0, "table"]
    assert float(table @ table) > FLOOR * table.size  # what white noise of both encoders does not explain
    assert right.noise_ratios[0]["table"] == pytest.approx(1.0, abs=0.1)
    softer = evaluated(Hypothesis(bench(damping_ratio=damping, stiffness_n_m=4e7)), data)
    assert softer.noise_ratios[0]["table"] > 2.0 * FLOOR  # and physics is none of that noise


def test_counts_of_the_table_encoder_pull_at_a_resting_motor_and_are_no_physics() -> None:
    count_m = 4e-6
    coarse = bench(coulomb_torque_n_m=0.3, stiffness_n_m=1.2e8).model_dump(mode="json", exclude_none=True)
    coarse["encoders"]["table"]["resolution_m"] = count_m
    truth = Bench.model_validate(coarse)
    recording = recorded(truth)
    counted = changed(recording, table_position_m=np.round(recording["table_position_m"] / count_m) * count_m)
    data = dataset([take(counted, truth)], truth, observer_s=0.002)
    right = evaluated(Hypothesis(truth), data)
    motor = right.residuals.parts[0, "motor"]
    assert float(motor @ motor) > FLOOR * motor.size  # what white noise of the motor encoder does not explain
    assert right.at_floor
    coarse["axis"]["coulomb_torque_n_m"] *= 1.05
    assert evaluated(Hypothesis(Bench.model_validate(coarse)), data).noise_ratios[0]["motor"] > FLOOR  # physics is none


def test_a_trifle_is_no_parameter_error() -> None:
    found = runs()
    almost = believed(found, coulomb_torque_n_m=1.1002)
    assert verdict_on_plant(almost, believed(found), believed(found), NONE) is Verdict.NO_MISMATCH


def test_wrong_parameters_are_a_parameter_error() -> None:
    found = runs(coulomb_torque_n_m=1.4)
    wrong, right = believed(found), believed(found, coulomb_torque_n_m=1.4)
    assert verdict_on_plant(wrong, right, right, runs(seed=2, coulomb_torque_n_m=1.4)) is Verdict.PARAMETER_ERROR


def test_a_term_that_explains_is_missing_physics() -> None:
    found = runs(LOAD)
    plain = believed(found)
    assert verdict_on_plant(plain, plain, believed(found, LOAD), runs(LOAD, seed=2)) is Verdict.MISSING_PHYSICS


def test_a_mismatch_without_a_term_or_with_a_poor_one_is_unexplained() -> None:
    found, held_out = runs(PLAY, LOAD), runs(PLAY, LOAD, seed=2)
    plain = believed(found)
    assert verdict_on_plant(plain, plain, plain, held_out) is Verdict.UNEXPLAINED
    poor = believed(found, Term("constant_load", 0, (0.02,)))
    assert mismatch_left(plain, poor, held_out) > 0.5
    assert verdict_on_plant(plain, plain, poor, held_out) is Verdict.UNEXPLAINED


def test_a_term_of_the_plant_answers_for_no_command_of_a_law_with_other_gains() -> None:
    weight, lag = Term("constant_load", 0, (0.02,)), Term("velocity_filter_lag", 0, (1e-3,))

    def run(seed: int) -> Dataset:
        plain = recorded(OWNER, weight, seed=seed)
        more = 0.1 * np.sin(0.05 * np.arange(len(plain)))
        command = plain["torque_command_n_m"] + more
        return dataset([take(changed(plain, torque_command_n_m=command), OWNER)], OWNER)

    found, held_out = run(1), run(2)

    def left(*terms: Term, of_law: frozenset[str] = frozenset()) -> float:
        (answer,) = explanation(believed(found), believed(found, *terms), held_out, of_law)
        return float(answer.figures["left"])

    told = Correction(value=2.0, std=0.01, unit="N m s/rad", nominal=1.0)
    of_law = LawCheck(OWNER, corrections={"velocity_gain_n_m_s_rad": told}).channels
    assert LawCheck(OWNER).channels == frozenset()
    assert left(weight, of_law=of_law) < 0.6 * left(weight)
    assert left(weight, lag, of_law=of_law) == left(weight, lag)


def test_a_name_that_is_not_believed_beside_a_twin_at_the_noise_is_no_mismatch() -> None:
    """A term may reduce one channel and increase another: if all are at the noise without it, it is not reported."""
    found = runs()
    plain, made_up = believed(found), believed(found, LOAD)
    assert verdict_on_plant(plain, plain, made_up, runs(seed=2)) is Verdict.NO_MISMATCH


@pytest.mark.parametrize(
    ("left", "above", "stands"),
    [
        (0.04, 50.0, True),
        (0.06, 5.2, False),
        (0.10, 1.6, True),
        (0.17, 1.6, False),
        (0.30, 1.25, True),
        (0.30, 1.3, False),
        (0.51, 1.0, False),
        (np.nan, 1.0, False),
        (0.3, np.nan, False),
    ],
)
def test_names_stand_beside_what_is_little_or_hardly_above_the_noise(left: float, above: float, stands: bool) -> None:
    """`above` in rms: the share that may be left falls as it stands further above the noise."""
    assert names_stand(left, above**2) is stands


def test_a_term_that_held_out_recordings_speak_against_is_dropped() -> None:
    train, held_out = runs(LOAD), runs(seed=2)  # the load has gone
    plain, loaded = believed(train), believed(train, LOAD)
    proof = cross_validate(plain, loaded, held_out)
    assert proof.final is plain
    assert [ablation.term for ablation in proof.dropped] == [LOAD]
    kept = cross_validate(plain, loaded, runs(LOAD, seed=2))
    assert kept.final is loaded
    assert kept.ablations[0].shown
    assert kept.ablations[0].train > 2.0


@pytest.mark.parametrize("term", [Term("cogging_torque", 0, (0.1, 6.0, 0.2)), Term("current_loop_lag", 0, (1e-3,))])
def test_what_makes_held_out_recordings_worse_than_a_refit_is_dropped_and_has_no_name(term: Term) -> None:
    train, held_out = runs(term), runs(seed=2)  # the effect has gone
    nominal, found = fit_nominal_parameters(train), believed(train, term)
    proof = cross_validate(nominal, found, held_out)
    assert [ablation.term for ablation in proof.dropped] == [term]
    assert verdict_on_plant(nominal, nominal, proof.final, held_out) is Verdict.UNEXPLAINED
    # nor is it believed where it was not dropped
    assert verdict_on_plant(nominal, nominal, found, held_out) is Verdict.UNEXPLAINED


def test_a_term_that_speaks_of_one_lap_only_is_dropped_unless_it_is_seen_there() -> None:
    once = Term("external_force", 0, (200.0, 0.8, 1.2))
    for truth, dropped in (((), [once]), ((once,), [])):
        train = dataset([take(recorded(OWNER, *truth, times=2), OWNER)], OWNER)
        proof = cross_validate(believed(train), believed(train, once), NONE)
        assert [ablation.term for ablation in proof.dropped] == dropped


def test_a_term_that_held_out_recordings_do_not_show_may_stay() -> None:
    late = Term("external_force", 0, (200.0, 1.0, 1.3))
    train = runs(late)
    held_out = [take(recorded(OWNER), OWNER)]
    short = [rows_of(run, slice(900)) for run in held_out]
    proof = cross_validate(believed(train), believed(train, late), dataset(short, OWNER))
    assert not proof.dropped
    assert not proof.ablations[0].shown


def test_a_constant_load_is_called_by_its_commoner_name_and_both_are_listed() -> None:
    train = runs(LOAD)
    plain, loaded = believed(train), fitted(Hypothesis(OWNER, (LOAD,)), train, evaluations=8)
    search = searched(plain, plain, loaded, {LOAD.key: [RivalFit.of(plain_with(train), 500.0)]}, {LOAD.key: 900.0})
    final = renamed(loaded)
    proof = cross_validate(plain, final, runs(LOAD, seed=2))
    (found,) = findings(search, proof.final, proof.ablations, {}, runs(LOAD, seed=2))
    assert found.effect == "asymmetric_friction"
    assert found.equivalents == ("constant_load",)
    assert [rival.effect for rival in found.rivals] == ["spring_load"]
    assert "evidence against it 500" in found.rivals[0].evidence
    value = found.parameters["offset_torque_n_m"]
    assert value.unit == "N m"
    assert value.value == pytest.approx(0.4, abs=max(4.0 * value.std, 0.002))
    assert value.std < 0.02
    after = diagnosed_bench(OWNER, proof.final)
    assert after.mechanisms[0].effect == "asymmetric_friction"
    assert after.drive == OWNER.drive


def plain_with(train: Dataset) -> Fit:
    """A poor rival."""
    return believed(train, Term("spring_load", 0, (10.0, 0.0)))


def test_standard_errors_cover_the_truth() -> None:
    """Errors of all parameters over their stated standard errors, on axes with other masses and friction."""
    errors = []
    for seed in range(6):
        scale = np.random.default_rng(seed).uniform(0.8, 1.25, len(OWNER.axis.NOMINAL))
        truth = {
            name: float(getattr(OWNER.axis, name) * factor)
            for name, factor in zip(OWNER.axis.NOMINAL, scale, strict=True)
        }
        found = fitted(Hypothesis(OWNER), runs(seed=seed, **truth))
        errors.append((np.array(found.hypothesis.values) - list(truth.values())) / standard_errors(found))
    assert 0.3 < float(np.sqrt(np.mean(np.square(errors)))) < 2.5


def test_what_this_motion_cannot_show() -> None:
    train = runs()
    hidden = not_testable(fitted(Hypothesis(OWNER), train, evaluations=4))
    assert "torque_saturation" in hidden  # the torque stays far from its limit
    assert "thermal_growth" in hidden  # three seconds
    assert not {"constant_load", "backlash", "stribeck_friction", "periodic_lead_error"} & set(hidden)


def test_without_a_linear_encoder_only_what_the_motor_feels_can_be_shown() -> None:
    blind = OWNER.model_copy(update={"encoders": OWNER.encoders.model_copy(update={"table": None})})
    train = [take(recorded(OWNER), blind)]
    hidden = not_testable(fitted(Hypothesis(blind), train, evaluations=4))
    assert {"backlash", "thermal_growth"} <= set(hidden)
    assert "periodic_lead_error" not in hidden  # the table reacts on the motor
    # a load that swings pushes back on the motor
    assert not {"constant_load", "structural_mode"} & set(hidden)
