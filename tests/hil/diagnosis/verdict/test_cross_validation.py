"""A term is named, and a parameter corrected, only where the recordings bear it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_runs import bench, changed, dataset, evaluated, fitted, recorded
from scipy.signal import lfilter

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.notes import _on_fit, at_bound
from hil.diagnosis.search.initial_values import axis_facts, claimable
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.findings import corrections
from hil.diagnosis.verdict.refit import reported_refit
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import _within, standard_errors
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.twin.library import BY_ID

OWNER = bench()
KUKA = Path(__file__).parents[3].parent / "shared" / "recordings" / "kuka" / "axis1_a.csv"
TRAVEL_M = 0.06  # of the recorded motion


def runs(*terms: Term, seed: int = 1, owner: Bench = OWNER) -> Dataset:
    return dataset([take(recorded(OWNER, *terms, seed=seed), owner)], owner)


@pytest.fixture(scope="module")
def train() -> Dataset:
    return runs()


@pytest.mark.parametrize(
    ("term", "stands"),
    [
        (Term("position_dependent_friction", 0, (0.1, 0.9 * TRAVEL_M, 0.0)), True),
        (Term("position_dependent_friction", 0, (0.1, 1.1 * TRAVEL_M, 0.0)), False),
        (Term("encoder_eccentricity", 0, (1e-3, 0.0)), True),  # once per revolution: 10 mm
        (Term("cogging_torque", 0, (0.1, 6.0, 0.0)), True),
    ],
)
def test_a_wave_longer_than_the_travel_has_no_name(train: Dataset, term: Term, stands: bool) -> None:
    assert claimable(term, OWNER, train.runs) is stands


@pytest.mark.parametrize(
    ("term", "stands"),
    [
        (Term("scale_interpolation_error", 0, (2e-6, 2.7e-3, 0.0)), True),
        (Term("scale_interpolation_error", 0, (2e-6, OWNER.axis.lead_m, 0.0)), False),  # an error of the screw
        (Term("scale_interpolation_error", 0, (2e-6, 0.5 * OWNER.axis.lead_m, 0.0)), False),
        (Term("thermal_growth", 0, (5e-5, 20.0)), True),
        (Term("thermal_growth", 0, (5e-5, 1.0)), False),  # at once: another lead
        (Term("structural_mode", 0, (40.0, 0.05, 0.1)), True),
        (Term("structural_mode", 0, (40.0, 0.9, 0.1)), False),  # no resonance
    ],
)
def test_values_that_belong_to_another_cause_have_no_name(train: Dataset, term: Term, stands: bool) -> None:
    assert claimable(term, OWNER, train.runs) is stands


def test_once_per_revolution_is_not_told_by_part_of_one() -> None:
    facts = axis_facts(load_bench("rotary").sampled(1e-3))
    mechanism = BY_ID["encoder_eccentricity"]
    assert mechanism.is_valid((1e-3, 0.0), 0, replace(facts, travel_m=7.0))
    assert not mechanism.is_valid((1e-3, 0.0), 0, replace(facts, travel_m=6.0))  # less than 2 pi


def test_a_dead_zone_lets_the_drive_move_the_axis(train: Dataset) -> None:
    run = train.runs[0]
    usual = float(np.median(np.abs(run.torque_command[np.abs(np.diff(run.motor, append=run.motor[-1])) > 1e-4])))
    for share, stands in ((0.1, True), (2.0, False)):
        assert claimable(Term("torque_dead_zone", 1, (share * usual,)), OWNER, train.runs) is stands


@pytest.mark.parametrize(("limit_n_m", "stands"), [(2.0, True), (4.0, False)])
def test_a_torque_limit_is_seen_as_a_plateau(limit_n_m: float, stands: bool) -> None:
    """A command above 2 N m for 100 ms at a time and above 4 N m for 5 ms."""
    command = np.concatenate([np.zeros(500), np.full(100, 2.5), np.full(5, 5.0), np.full(100, -2.5), np.zeros(2000)])
    run = replace(runs().runs[0], torque_command=np.tile(command, 2)[: runs().runs[0].motor.size])
    assert claimable(Term("torque_saturation", 0, (limit_n_m,)), OWNER, [run]) is stands


def test_a_strength_below_its_standard_error_is_dropped(train: Dataset) -> None:
    small = fitted(Hypothesis(OWNER, (Term("cogging_torque", 0, (1e-4, 7.0, 0.2)),)), train, evaluations=6)
    plain = fitted(Hypothesis(OWNER), train, evaluations=6)
    error = standard_errors(small)[small.hypothesis.columns(0)][0]
    assert small.terms[0].values[0] < error
    proof = cross_validate(plain, small, runs(seed=2))
    assert [ablation.refuted for ablation in proof.dropped] == ["its strength is below its standard error"]


def test_a_term_that_harms_the_training_recordings_is_dropped(train: Dataset) -> None:
    load = Term("constant_load", 0, (0.4,))
    wrong = evaluated(Hypothesis(OWNER, (load,)), train)
    proof = cross_validate(evaluated(Hypothesis(OWNER), train), wrong, dataset([], OWNER))
    (dropped,) = proof.dropped
    assert "motor_position_rad" in dropped.worse
    assert "reproduced worse in motor_position_rad" in dropped.refuted


def test_a_term_beside_a_refit_that_is_worse_than_the_bench_file_is_dropped(train: Dataset) -> None:
    """Twice the Coulomb friction: with the term the motor is no worse than without it, but than the bench file."""
    plain = Hypothesis(OWNER)
    names = [coordinate.name for coordinate in plain.coordinates]
    x = plain.x.copy()
    x[names.index("coulomb_torque_n_m")] = np.log(2.0)
    nominal = evaluated(plain.moved(x), train)
    final = evaluated(nominal.hypothesis.with_term(Term("cogging_torque", 0, (0.01, 6.0, 0.0))), train)
    (dropped,) = cross_validate(nominal, final, dataset([], OWNER)).dropped
    assert "motor_position_rad" in dropped.worse


def test_a_parameter_at_its_bound_is_no_correction() -> None:
    light = bench(table_mass_kg=384.0 / 5.0)
    data = runs(owner=light)
    found = reported_refit(fitted(Hypothesis(light), data)).fit
    assert at_bound(found) == ("table_mass_kg",)
    assert "table_mass_kg" not in corrections(light, found)
    assert any("table_mass_kg: not identifiable from this motion" in note for note in _on_fit(found))


def test_standard_errors_count_what_the_model_leaves_with_its_correlation() -> None:
    """A torque of 0.05 N m that wanders within seconds is no load: few errors are above three standard errors."""
    ratios = []
    for seed in range(8):
        recording = recorded(OWNER, seed=seed, times=2)
        keeps = np.exp(-1e-3)  # over a row of 1 ms
        steps = np.random.default_rng(seed).normal(0.0, 1.0, len(recording) + 5000)
        wander = 0.05 * np.sqrt(1.0 - keeps**2) * lfilter([1.0], [1.0, -keeps], steps)[5000:]
        torque = recording["torque_n_m"] + wander
        data = dataset([take(changed(recording, torque_n_m=torque, torque_command_n_m=torque), OWNER)], OWNER)
        found = fitted(Hypothesis(OWNER, (Term("constant_load", 0, (0.01,)),)), data)
        ratios.append(abs(found.terms[0].values[0]) / standard_errors(found)[found.hypothesis.columns(0)][0])
    assert sum(ratio < 3.0 for ratio in ratios) >= 7


def kuka() -> tuple[Recording, Bench]:
    """Motion of the robot's first axis at the motor, with the encoder on the link side, and a bench without a law."""
    if not KUKA.exists():
        pytest.skip("the KUKA recording is not beside the repository")
    names = KUKA.read_text().splitlines()[0].split(",")
    table = dict(zip(names, np.loadtxt(KUKA, delimiter=",", skiprows=1).T, strict=True))
    columns = {
        "time_s": table["time_s"],
        "motor_position_rad": np.deg2rad(table["motor_position_deg"]),
        "table_position_m": np.deg2rad(table["secondary_position_deg"]),
        "torque_n_m": table["motor_torque_n_m"],
    }
    rotary = load_bench("rotary")
    axis = rotary.axis.model_copy(
        update={"inertia_kg_m2": 7.9, "coulomb_torque_n_m": 1.55, "viscous_torque_n_m_s_rad": 7.0}
    )
    encoders = rotary.encoders.model_copy(
        update={
            "motor": rotary.encoders.motor.model_copy(update={"counts_per_rev": 2785974}),
            "table": load_bench("reference").encoders.table,
        }
    )
    return Recording("axis1", columns, 0.004), rotary.model_copy(update={"axis": axis, "encoders": encoders})


def test_the_late_encoder_of_a_robot_axis_is_found_and_nothing_else() -> None:
    """What is left is 30 times the noise of the encoders: no name for it."""
    recording, owner = kuka()
    result = diagnose([recording], [], owner).result
    (finding,) = result.missing
    assert (finding.effect, finding.variant) == ("channel_time_skew", "table_position")
    assert finding.parameters["delay_s"].value == pytest.approx(3.07e-3, abs=0.1e-3)
    motor = result.fit["motor_position_rad"]
    assert motor.train.before_rms <= motor.train.owner_rms
    assert max(motor.train.before_rms, motor.train.owner_rms or 0.0) < 1e-4  # it was 6e39 rad
    assert "Not explained: residuals above the noise" in result.statement
    left = result.torque_left
    assert left is not None
    assert max(left.final, left.plain) < 0.5  # of the torque of the whole move
    assert left.owner < left.plain  # the bench as given; the refit to the motion leaves 1 % more than the plain model
    assert (left.final < left.plain) != any("more than plain least squares" in note for note in result.notes)


def test_bounds_of_a_nominal_parameter_tell_what_is_confounded_with_it() -> None:
    """Only the sum of two values is known, to 0.1; the first lies within bounds 1.2 apart."""
    known, width = 0.1, 1.2
    unknown = 1e4
    covariance = np.array([[unknown, -unknown], [-unknown, unknown + known**2]])
    within = _within(covariance, np.array([width]))
    assert within[0, 0] == pytest.approx(width**2 / 12.0, rel=1e-4)
    assert within[1, 1] == pytest.approx(width**2 / 12.0 + known**2, rel=1e-4)
    precise = np.diag([1e-6, 2e-6])
    assert _within(precise, np.array([width])) == pytest.approx(precise, rel=1e-4, abs=1e-12)
    assert np.array_equal(_within(precise, np.zeros(0)), precise)
