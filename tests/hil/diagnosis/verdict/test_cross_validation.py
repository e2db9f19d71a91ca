"""A term stands only where the training and the held-out recordings bear it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, fitted, recorded

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.acceptance import paying
from hil.diagnosis.search.addition import torque_of
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()


def runs(*terms: Term, seed: int = 1, owner: Bench = OWNER) -> Dataset:
    return dataset([take(recorded(OWNER, *terms, seed=seed), owner)], owner)


@pytest.fixture(scope="module")
def train() -> Dataset:
    return runs()


def test_a_strength_below_its_standard_error_is_dropped(train: Dataset) -> None:
    small = fitted(Hypothesis(OWNER, (Term("cogging_torque", 0, (1e-4, 7.0, 0.2)),)), train, evaluations=6)
    plain = fitted(Hypothesis(OWNER), train, evaluations=6)
    error = standard_errors(small)[small.hypothesis.columns(0)][0]
    assert small.terms[0].values[0] < error
    proof = cross_validate(plain, small, train.over(()))
    assert [ablation.refuted for ablation in proof.dropped] == ["its strength is below its standard error"]


def test_a_term_that_harms_the_training_recordings_is_dropped(train: Dataset) -> None:
    load = Term("constant_load", 0, (0.4,))
    wrong = evaluated(Hypothesis(OWNER, (load,)), train)
    proof = cross_validate(evaluated(Hypothesis(OWNER), train), wrong, dataset([], OWNER))
    (dropped,) = proof.dropped
    assert "motor_position_rad" in paying(dropped.harm)
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
    assert "motor_position_rad" in paying(dropped.harm)


@pytest.mark.parametrize(
    ("term", "tells"),
    [
        (Term("channel_time_skew", 0, (2e-3,)), False),  # of the second encoder
        (Term("scale_interpolation_error", 0, (1e-6, 2e-5, 0.1)), False),
        (Term("channel_time_skew", 2, (2e-3,)), True),  # of the motor's
        (Term("table_side_friction", 0, (0.3,)), True),
        (Term("transport_delay", 0, (1e-3,)), False),  # the measured torque has it already
    ],
)
def test_the_torque_is_no_witness_of_a_term_that_does_not_act_on_it(train: Dataset, term: Term, tells: bool) -> None:
    """Twice the Coulomb friction, which the bench file has right, is the matter of the other parameters."""
    owner = load_bench("reference_7dof")
    data = train.over(train.runs)
    given = evaluated(Hypothesis(owner), dataset(data.runs, owner))
    x = given.hypothesis.x.copy()
    x[[one.name for one in given.hypothesis.coordinates].index("coulomb_torque_n_m")] = np.log(2.0)
    nominal = evaluated(given.hypothesis.moved(x), given.data)
    final = evaluated(nominal.hypothesis.with_term(term), given.data)
    assert (torque_of(final, nominal, term, given.data, given) is not None) == tells


def test_the_rival_that_training_does_not_tell_from_a_refuted_term_takes_its_place() -> None:
    """A load beside cogging that is not there; what else is tied with it is not tried again."""
    load = Term("constant_load", 0, (0.4,))
    data, plain = runs(load), Hypothesis(OWNER)
    nominal = evaluated(plain, data)
    wrong = evaluated(Hypothesis(OWNER, (Term("cogging_torque", 0, (0.4, 7.0, 0.2)),)), data)
    offset = RivalFit((Term("constant_load", 0, (0.2,)),), 1.0, 0.0, 0.0)
    play = RivalFit((Term("backlash", 0, (5e-5,)),), 1.0, 0.0, 0.0)
    key = wrong.terms[0].key
    proof = cross_validate(nominal, wrong, data.over(()), {key: [offset, play]})
    (named,) = proof.final.terms
    assert named.effect == "constant_load"
    assert named.values[0] == pytest.approx(0.4, rel=0.05)
    assert [one.term.key for one in proof.dropped] == [key]
    assert [one.terms for one in proof.rivals[named.key]] == [play.terms]
    objected = replace(offset, objection="it is late")
    assert cross_validate(nominal, wrong, data.over(()), {key: [objected]}).final.terms == ()


def test_the_rival_that_predicts_more_of_the_held_out_torque_takes_the_name() -> None:
    """A spring was named a weight, which training is said not to tell from it."""
    spring, load = Term("spring_load", 0, (4e3, 0.1)), Term("constant_load", 0, (0.4,))
    data, held_out = runs(spring), runs(spring, seed=2)
    nominal = evaluated(Hypothesis(OWNER), data)
    weight = fitted(Hypothesis(OWNER, (load,)), data, evaluations=6)
    tied, key = RivalFit((spring,), 1.0, 0.0, 0.0), weight.terms[0].key

    proof = cross_validate(nominal, weight, held_out, {key: [tied]})
    (named,) = proof.final.terms
    assert named.effect == "spring_load"
    assert proof.dropped == ()
    (rival,) = proof.rivals[named.key]
    assert rival.terms[0].effect == "constant_load"
    assert not rival.tied

    refuted = replace(tied, evidence=100.0, more=1.0)
    assert cross_validate(nominal, weight, held_out, {key: [refuted]}).final.terms[0].effect == "constant_load"


def test_another_variant_of_a_dropped_mechanism_takes_its_place() -> None:
    """The second encoder is late; a motor's encoder that is early moves the torque against the motion too."""
    late = Term("channel_time_skew", 0, (2e-3,))
    data = runs(late)
    nominal = evaluated(Hypothesis(OWNER), data)
    early = evaluated(Hypothesis(OWNER, (Term("channel_time_skew", 2, (-2e-3,)),)), data)
    proof = cross_validate(nominal, early, runs(late, seed=2))
    (named,) = proof.final.terms
    assert (named.effect, named.variant) == ("channel_time_skew", 0)
    assert named.values[0] == pytest.approx(2e-3, rel=0.02)
    assert [one.term.variant for one in proof.dropped] == [2]
