"""A small drag that corrects the form of a friction curve is reported with that curve, a larger one separately."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest
from diagnosis_runs import bench, dataset, fitted, recorded, searched

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import Finding
from hil.diagnosis.search.rivals import RivalFit
from hil.diagnosis.verdict.cross_validation import CrossValidation, cross_validate
from hil.diagnosis.verdict.findings import diagnosed_bench, findings, form_of
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.measured import take
from hil.identification.terms import Key, Term

OWNER = bench()
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
        fitted(Hypothesis(OWNER), train, evaluations=6),
        fitted(Hypothesis(OWNER, tuple(terms)), train, evaluations=6),
    )
    proof = cross_validate(plain, right, held_out)
    tied = {
        key: [RivalFit.of(fitted(Hypothesis(OWNER, (rival,)), train, evaluations=1), 0.0)]
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
    assert smaller > CRITERIA.part_of_form * larger
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
    assert smaller < CRITERIA.part_of_form * larger
    assert forms == {}
    assert len(found) == 2
