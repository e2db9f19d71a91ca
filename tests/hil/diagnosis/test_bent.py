"""A preload that is lost, which a refit hides in other springs and in their damping."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, recorded

from hil.bench import load_bench
from hil.diagnosis import search
from hil.diagnosis.bent import unbent
from hil.diagnosis.fit import evaluate
from hil.diagnosis.model import Model
from hil.diagnosis.terms import Term
from hil.measured import take

LOST = Term("preload_loss", 0, (60e-6, 0.08))      # wider than the nut moves under these loads: it never leaves its gap


def test_it_is_found_although_the_refit_leaves_next_to_nothing() -> None:
    owner = load_bench("reference_7dof")
    axis = owner.axis
    true = {"nut_support_stiffness_n_m": 0.85 * axis.nut_support_stiffness_n_m,
            "table_mass_kg": 1.15 * axis.table_mass_kg}
    truth = owner.model_copy(update={"axis": axis.model_copy(update=true)})
    run = take(recorded(truth, LOST, times=2), owner)
    base = search.nominal(owner, [run])
    assert base.cost < 0.05 * evaluate(Model(owner), [run]).cost
    assert "preload_loss" not in [lead.term.effect for lead in search.leads(base, [run]) if lead.share > 0.01]
    (found,) = unbent(base, [run])
    assert found.cost <= evaluate(Model(truth, (LOST,)), [run]).cost < base.cost
    bench, (lost,) = found.model.resolved(found.x)
    assert lost.values[1] == pytest.approx(0.08, rel=0.1)
    assert bench.axis.table_mass_kg == pytest.approx(truth.axis.table_mass_kg, rel=0.02)


def test_of_one_spring_it_would_be_that_spring() -> None:
    owner = bench()
    base = search.nominal(owner, [take(recorded(owner), owner)])
    assert unbent(base, [take(recorded(owner), owner)]) == []


def test_beside_a_lost_preload_it_is_not_looked_for_again() -> None:
    owner = load_bench("reference_7dof")
    run = take(recorded(owner), owner)
    assert unbent(evaluate(Model(owner, (LOST,)), [run]), [run]) == []
