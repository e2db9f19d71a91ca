"""Findings: names and values, two of a name, the form of a friction curve, rivals in words, and corrections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import diagnosis_runs
import pytest
from diagnosis_runs import bench, dataset, recorded, searched

from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.notes import at_bound, on_fit
from hil.diagnosis.result import Finding
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.search.score_test import screen_library
from hil.diagnosis.verdict.corrections import corrections, diagnosed_bench
from hil.diagnosis.verdict.cross_validation import CrossValidation, cross_validate
from hil.diagnosis.verdict.findings import findings, form_of, renamed, rival_in_words
from hil.diagnosis.verdict.refit import reported_refit
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.measured import take
from hil.identification.terms import Key, Term

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


def test_a_mechanism_is_offered_again_at_another_order() -> None:
    train = runs(SIX, FIFTEEN)
    offered = {one.term.effect: one.term for one in screen_library(fitted(train, SIX))}
    assert offered["cogging_torque"].slot == 1
    assert offered["cogging_torque"].values[1] == 15.0
    full = [
        SIX,
        FIFTEEN,
        *(replace(SIX, values=(0.01, order, 0.0), slot=slot) for order, slot in ((24.0, 2), (36.0, 3))),
    ]
    assert "cogging_torque" not in {one.term.effect for one in screen_library(fitted(train, *full))}


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


COULOMB = OWNER.axis.physics().coulomb_n_m
FALLING = Term("stribeck_friction", 1, (2.0 * COULOMB, 2.0))
RIPPLE = Term("cogging_torque", 0, (0.02 * COULOMB, 12.0, 0.5))


def drag(share: float, variant: int = 0) -> Term:
    """That takes a share of Coulomb friction at 100 rad/s."""
    return Term("nonlinear_viscous_friction", variant, (share * COULOMB / 100.0**2,))


def diagnosed(
    terms: Sequence[Term], rivals: Mapping[Key, Term] | None = None
) -> tuple[CrossValidation, dict[int, int], tuple[Finding, ...]]:
    """Findings on recordings of these terms with these terms fitted, and with tied rivals of a term."""
    train, held_out = (
        dataset([take(recorded(OWNER, *terms, seed=seed, torque_noise_n_m=0.001), OWNER)], OWNER) for seed in (1, 2)
    )
    plain, right = (
        diagnosis_runs.fitted(Hypothesis(OWNER), train, evaluations=6),
        diagnosis_runs.fitted(Hypothesis(OWNER, tuple(terms)), train, evaluations=6),
    )
    proof = cross_validate(plain, right, held_out)
    tied = {
        key: [RivalFit.of(diagnosis_runs.fitted(Hypothesis(OWNER, (rival,)), train, evaluations=1), 0.0)]
        for key, rival in (rivals or {}).items()
    }
    search = searched(plain, plain, right, tied, {term.key: 900.0 for term in terms})
    forms = form_of(search, proof.ablations)
    return proof, forms, findings(search, proof.final, proof.ablations, forms, held_out)


@pytest.mark.parametrize("terms", [(FALLING, drag(0.02)), (drag(0.02), FALLING)])
def test_a_little_drag_is_the_form_of_a_falling_curve(terms: tuple[Term, ...]) -> None:
    proof, forms, found = diagnosed(terms)
    falling, little = terms.index(FALLING), 1 - terms.index(FALLING)
    assert forms == {little: falling}
    assert proof.ablations[little].shown, "it does help: that is not why it is no cause"
    (finding,) = found
    assert finding.effect == "stribeck_friction"
    assert "square of the speed" in finding.form
    static = finding.parameters["static_torque_n_m"]
    assert static.value == pytest.approx(FALLING.values[0], rel=0.01)
    of_the_term = proof.final.hypothesis.columns(falling).start
    assert static.std == standard_errors(proof.final)[of_the_term]
    assert {entry.effect for entry in diagnosed_bench(OWNER, proof.final).mechanisms} == {
        "stribeck_friction",
        "nonlinear_viscous_friction",
    }, "the bench has the curve as it was fitted"


def test_what_is_found_beside_an_effect_is_not_its_equal() -> None:
    load, slope = Term("constant_load", 0, (0.3,)), Term("cumulative_lead_error", 0, (1e-4,))
    train, held_out = runs(load, slope), runs(load, slope, seed=2)
    plain, both = fitted(train), fitted(train, load, slope)
    rivals = {load.key: [RivalFit.of(fitted(train, one), 1.0) for one in (slope, Term("spring_load", 0, (1e3, 0.0)))]}
    search = searched(plain, plain, both, rivals, {one.key: 900.0 for one in (load, slope)})
    found = findings(search, both, cross_validate(plain, both, held_out).ablations, {}, held_out)
    equals = {one.effect: one.equivalents for one in found}
    assert "spring_load" in equals["constant_load"]
    assert slope.effect not in equals["constant_load"]


def test_a_drag_that_may_be_something_else_is_told() -> None:
    load = Term("torque_constant_saturation", 0, (0.01,))
    _, forms, found = diagnosed((FALLING, drag(0.02)), {drag(0.02).key: load})
    assert forms == {}
    assert [finding.equivalents for finding in found if finding.effect == "nonlinear_viscous_friction"] == [
        ("torque_constant_saturation",)
    ]


def test_much_drag_is_a_cause_of_its_own() -> None:
    proof, forms, found = diagnosed((FALLING, drag(0.5)))
    smaller, larger = sorted(ablation.train - 1.0 for ablation in proof.ablations)
    assert smaller > CRITERIA.worth * larger
    assert forms == {}
    assert sorted(finding.effect for finding in found) == ["nonlinear_viscous_friction", "stribeck_friction"]
    assert not any(finding.form for finding in found)


@pytest.mark.parametrize(
    "terms",
    [
        (FALLING, RIPPLE),
        (FALLING, drag(0.01, variant=1)),
        (Term("stribeck_friction", 1, (1.05 * COULOMB, 0.5)), drag(2.0)),
    ],
    ids=["cogging", "thinning", "low speed alone"],
)
def test_nothing_else_is_a_form_however_little_it_takes(terms: tuple[Term, ...]) -> None:
    proof, forms, found = diagnosed(terms)
    smaller, larger = sorted(ablation.train - 1.0 for ablation in proof.ablations)
    assert smaller < CRITERIA.worth * larger
    assert forms == {}
    assert len(found) == 2


@pytest.mark.parametrize(
    ("rival", "said"),
    [
        (
            {"evidence": 10628.0, "more": 0.2},
            "leaves residuals of 0.900 × the noise (rms), backlash in its place 0.800 ×; evidence against it 10628",
        ),
        ({"evidence": -881.0, "objection": "it is excluded"}, "evidence for it 881, where 10 is very strong, but it"),
        ({"evidence": -881.0, "behind": "it has more parameters"}, "evidence for it 881, where 10 is very strong, but"),
        ({"evidence": 1114.0, "more": 0.001}, "evidence against it 1114, where 10 is very strong, but the difference"),
        ({"evidence": 3.0}, "not distinguishable from backlash by this motion: leaves residuals of 0.900 ×"),
    ],
)
def test_the_sentence_says_what_decides(rival: dict[str, Any], said: str) -> None:
    other = RivalFit((Term("preload_loss", 0, (1e-5, 0.4)),), 0.81, named=0.64, **rival)
    assert said in rival_in_words(other, Term("backlash", 0, (1e-5,)))
    assert other.tied == (not other.objection and (other.evidence < 10.0 or other.more < 0.005))


def test_a_parameter_at_its_bound_is_no_correction() -> None:
    light = bench(table_mass_kg=384.0 / 5.0)
    data = dataset([take(recorded(OWNER), light)], light)
    found = reported_refit(diagnosis_runs.fitted(Hypothesis(light), data)).fit
    assert at_bound(found) == ("table_mass_kg",)
    assert not set(corrections(light, found)) & set(light.axis.MASSES), "the split of the masses is not told"
    assert "coulomb_torque_n_m" in corrections(light, found)
    assert any("table_mass_kg: not identifiable from this motion" in note for note in on_fit(found))
