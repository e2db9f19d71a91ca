"""Names of findings: which are the same torque, which are not, and one name for two causes."""

from __future__ import annotations

import diagnosis_runs
import pytest
from diagnosis_runs import bench, dataset, recorded, searched

from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.search.score_test import screen_library
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.findings import diagnosed_bench, findings, renamed
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term, compatible, repeats

OWNER = bench()


def runs(*terms: Term, seed: int = 1) -> Dataset:
    return dataset([take(recorded(OWNER, *terms, seed=seed), OWNER)], OWNER)


def fitted(found: Dataset, *terms: Term) -> Fit:
    """A hypothesis from close to the truth."""
    return diagnosis_runs.fitted(Hypothesis(OWNER, terms), found, evaluations=6)


def test_friction_that_differs_with_speed_is_no_constant_load() -> None:
    truth, load = Term("asymmetric_friction", 1, (0.15,)), Term("constant_load", 0, (0.1,))
    train, held_out = runs(truth), runs(truth, seed=2)
    plain, right, rival = fitted(train), fitted(train, truth), fitted(train, load)
    search = searched(plain, plain, right, {truth.key: [RivalFit.of(rival, 500.0)]}, {truth.key: 900.0})
    final = renamed(right)
    (found,) = findings(search, final, cross_validate(plain, final, held_out).ablations, {}, held_out)
    assert (found.effect, found.variant, found.equivalents) == ("asymmetric_friction", "with speed", ())
    assert [other.effect for other in found.rivals] == ["constant_load"]
    value = found.parameters["offset_torque_n_m"]
    assert value.value == pytest.approx(0.15, abs=max(4.0 * value.std, 0.003))
    physics = final.bench.axis.physics()
    assert f"at {physics.viscous_speed:.0f} rad/s" in found.sentence
    after = diagnosed_bench(OWNER, final)
    assert after.twin().active == Bench.model_validate(after.model_dump()).twin().active
    assert after.twin().active[0].variant == 1


SIX, FIFTEEN = Term("cogging_torque", 0, (0.2, 6.0, 0.5)), Term("cogging_torque", 0, (0.15, 15.0, -1.0), slot=1)


def test_the_same_period_is_the_same_cause() -> None:
    assert repeats(SIX, Term("cogging_torque", 0, (0.5, 6.3, 0.0)))
    assert not repeats(SIX, FIFTEEN)
    assert not repeats(SIX, Term("torque_ripple", 0, (0.02, 6.0, 0.0)))
    assert compatible([SIX, FIFTEEN])
    assert not compatible([SIX, FIFTEEN, Term("cogging_torque", 0, (0.1, 30.0, 0.0))])


def test_the_same_torque_is_not_named_twice() -> None:
    load, friction = Term("constant_load", 0, (0.1,)), Term("asymmetric_friction", 0, (0.05,))
    assert not compatible([load, friction])
    assert compatible([load, Term("asymmetric_friction", 1, (0.05,)), SIX])  # with speed it is another torque


def test_a_mechanism_is_offered_again_at_another_order() -> None:
    train = runs(SIX, FIFTEEN)
    offered = {one.term.effect: one.term for one in screen_library(fitted(train, SIX))}
    assert offered["cogging_torque"].slot == 1
    assert offered["cogging_torque"].values[1] == 15.0
    assert "cogging_torque" not in {one.term.effect for one in screen_library(fitted(train, SIX, FIFTEEN))}


def test_two_of_a_name_are_two_findings_with_two_entries() -> None:
    train, held_out = runs(SIX, FIFTEEN), runs(SIX, FIFTEEN, seed=2)
    plain, right = fitted(train), fitted(train, SIX, FIFTEEN)
    search = searched(plain, plain, right, {}, {SIX.key: 900.0, FIFTEEN.key: 800.0})
    proof = cross_validate(plain, right, held_out)
    found = findings(search, proof.final, proof.ablations, {}, held_out)
    assert [finding.effect for finding in found] == ["cogging_torque", "cogging_torque"]
    orders = [finding.parameters["cycles_per_rev"].value for finding in found]
    assert orders == pytest.approx([6.0, 15.0], abs=0.02)
    after = diagnosed_bench(OWNER, proof.final)
    again = Bench.model_validate(after.model_dump())
    assert again.twin().active == proof.final.hypothesis.twin().active


def test_a_mechanism_that_the_bench_has_gives_way_to_the_one_found() -> None:
    def known(*terms: Term) -> Bench:
        entries = tuple(
            MechanismEntry(
                effect=term.effect,
                parameters=dict(zip(("amplitude_n_m", "cycles_per_rev", "phase_rad"), term.values, strict=True)),
            )
            for term in terms
        )
        return OWNER.model_copy(update={"mechanisms": entries})

    found = Hypothesis(known(SIX, FIFTEEN), (Term("cogging_torque", 0, (0.4, 6.1, 0.5)),))
    assert [entry.parameters["cycles_per_rev"] for entry in found.kept] == [15.0]
    assert len(found.twin().active) == 2
    assert len(Hypothesis(known(SIX), (FIFTEEN,)).kept) == 1
