"""Names and texts of findings: which share a name, which do not."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, recorded

from hil.bench import Bench
from hil.diagnosis.explain import Explanation, Rival
from hil.diagnosis.findings import diagnosed_bench, findings, renamed
from hil.diagnosis.fit import Fit, fit
from hil.diagnosis.model import Model, Term
from hil.diagnosis.proof import prove
from hil.measured import Measured, take

OWNER = bench()


def runs(*terms: Term, seed: int = 1) -> list[Measured]:
    return [take(recorded(OWNER, *terms, seed=seed), OWNER)]


def fitted(found: list[Measured], *terms: Term) -> Fit:
    """A hypothesis from close to the truth."""
    return fit(Model(OWNER, terms), found, evaluations=6)


def test_friction_that_differs_with_speed_is_no_constant_load() -> None:
    truth, load = Term("asymmetric_friction", 1, (0.15,)), Term("constant_load", 0, (0.1,))
    train, held_out = runs(truth), runs(truth, seed=2)
    plain, right, rival = fitted(train), fitted(train, truth), fitted(train, load)
    explanation = Explanation(plain, plain, right, {truth.key: [Rival(rival, 500.0)]}, {truth.key: 900.0})
    final = renamed(right)
    found, = findings(explanation, final, prove(plain, final, train, held_out).ablations, train, held_out)
    assert (found.effect, found.variant, found.equivalents) == ("asymmetric_friction", "with speed", ())
    assert [other.effect for other in found.rivals] == ["constant_load"]
    value = found.parameters["offset_torque_n_m"]
    assert value.value == pytest.approx(0.15, abs=max(4.0 * value.std, 0.003))
    physics = final.model.resolved(final.x)[0].axis.physics()
    assert f"at {physics.viscous_speed:.0f} rad/s" in found.sentence
    after = diagnosed_bench(OWNER, final)
    assert after.twin().active == Bench.model_validate(after.model_dump()).twin().active
    assert after.twin().active[0].variant == 1
