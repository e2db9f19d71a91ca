"""A preload that is lost, which a refit hides in other springs and in their damping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, recorded

from hil.bench.bench_file import Bench, MechanismEntry, load_bench
from hil.diagnosis.estimation.fit import evaluate
from hil.diagnosis.estimation.hypothesis import Model
from hil.diagnosis.estimation.terms import Term
from hil.diagnosis.search import successive_halving
from hil.diagnosis.search.forward_selection import explain
from hil.diagnosis.search.restart import from_owner, may_hide, unbent
from hil.identification.dataset import take

NOISE_N_M = 0.001
LOST = Term("preload_loss", 0, (60e-6, 0.08))  # wider than the nut moves under these loads: it never leaves its gap


def stiff_owner() -> tuple[Bench, Bench]:
    """An owner who is wrong about a spring and a mass, and the axis."""
    owner = load_bench("reference_7dof")
    axis = owner.axis
    true = {
        "nut_support_stiffness_n_m": 0.85 * axis.nut_support_stiffness_n_m,
        "table_mass_kg": 1.15 * axis.table_mass_kg,
    }
    return owner, owner.model_copy(update={"axis": axis.model_copy(update=true)})


def test_it_is_fitted_although_the_refit_leaves_next_to_nothing() -> None:
    owner, truth = stiff_owner()
    run = take(recorded(truth, LOST, times=2), owner)
    base = successive_halving.nominal(owner, [run])
    assert base.cost < 0.05 * evaluate(Model(owner), [run]).cost
    assert "preload_loss" not in [
        lead.term.effect for lead in successive_halving.leads(base, [run]) if lead.share > 0.01
    ]
    found = unbent(base, [run])
    assert found.cost <= evaluate(Model(truth, (LOST,)), [run]).cost < base.cost
    bench, (lost,) = found.model.resolved(found.x)
    assert lost.values[1] == pytest.approx(0.08, rel=0.1)
    assert bench.axis.table_mass_kg == pytest.approx(truth.axis.table_mass_kg, rel=0.02)


def test_it_is_named_where_what_is_left_matters() -> None:
    owner, truth = stiff_owner()
    for terms in ((LOST,), ()):
        found = explain(owner, [take(recorded(truth, *terms, torque_noise_n_m=NOISE_N_M), owner)])
        assert [term.effect for term in found.terms] == [term.effect for term in terms]


def test_of_one_spring_it_would_be_that_spring() -> None:
    owner = bench()
    run = take(recorded(owner), owner)
    mode = MechanismEntry(
        effect="structural_mode", parameters={"frequency_hz": 80.0, "damping_ratio": 0.05, "mass_ratio": 0.2}
    )
    for known in (owner, owner.model_copy(update={"mechanisms": (mode,)})):
        assert not may_hide(evaluate(Model(known), [run]), [run])


def test_beside_a_lost_preload_and_without_a_linear_encoder_it_is_not_looked_for() -> None:
    owner = load_bench("reference_7dof")
    run = take(recorded(owner), owner)
    assert may_hide(evaluate(Model(owner), [run]), [run])
    assert not may_hide(evaluate(Model(owner, (LOST,)), [run]), [run])
    assert not may_hide(evaluate(Model(owner), [run]), [replace(run, table_m=np.zeros(0))])


def test_where_a_screen_beside_the_refit_finds_nothing_the_owners_values_are_searched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A refit that nothing is found beside stands for those that lead astray: which do, depends on many digits."""
    owner = bench(table_mass_kg=300.0)
    pulled = Term("spring_load", 0, (6000.0, 0.02))
    run, plain = (take(recorded(bench(), *terms), owner) for terms in ((pulled,), ()))
    base = successive_halving.nominal(owner, [run])
    first = from_owner(base, [run])[0]
    assert first.cost < 1.1 * base.residuals.size < 0.1 * base.cost
    monkeypatch.setattr(successive_halving, "race", lambda base, found, runs: [])
    (spring,) = explain(owner, [run]).terms
    assert spring.effect == "spring_load"
    assert spring.values == pytest.approx(pulled.values, rel=0.02)
    assert explain(owner, [plain]).terms == ()
