"""Fits begun again at the parameters of the bench file, and a lost preload that a refit hides in other springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, evaluated, prepared, recorded

from hil.bench.bench_file import Bench, MechanismEntry, load_bench
from hil.diagnosis.search import next_term
from hil.diagnosis.search.forward_selection import search
from hil.diagnosis.search.restart import again, from_bench_file, may_hide, unbent
from hil.diagnosis.search.score_test import screen_library
from hil.identification.dataset import prepare_dataset
from hil.identification.estimator import Estimator
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

STRIBECK = Term("stribeck_friction", 0, (1.6, 2.0))


def test_a_fit_with_a_parameter_at_its_bound_is_fitted_from_the_bench_file() -> None:
    owner = bench()
    data = prepare_dataset([take(recorded(owner, STRIBECK), owner)], owner)
    wrong = Hypothesis(owner, (Term("stribeck_friction", 1, (3.0, 2e-5)),))  # too slow to act: nothing leads out of it
    corner = wrong.moved(wrong.x.copy())
    mass = [coordinate.name for coordinate in wrong.coordinates].index("table_mass_kg")
    corner.x[mass] = wrong.bounds[0][mass]
    stuck = Estimator(data).fit(corner, evaluations=10, fixed=[mass])
    assert not stuck.at_floor
    assert stuck.at_bound
    found = again(stuck, 40)
    assert found.at_floor
    assert [term.effect for term in found.terms] == ["stribeck_friction"]
    assert again(found, 40) is found  # at its floor there is nothing to look for


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


@pytest.mark.long
def test_it_is_fitted_although_the_refit_leaves_next_to_nothing() -> None:
    owner, truth = stiff_owner()
    run = take(recorded(truth, LOST, times=2), owner)
    base = fit_nominal_parameters(prepare_dataset([run], owner))
    assert base.cost < 0.05 * base.estimator.evaluate(base.hypothesis.given).cost
    assert "preload_loss" not in [one.term.effect for one in screen_library(base) if one.score > 0.01 * base.rows]
    found = unbent(base)
    assert found.cost <= base.estimator.evaluate(Hypothesis(truth, (LOST,))).cost < base.cost
    bench, (lost,) = found.hypothesis.resolved
    assert lost.values[1] == pytest.approx(0.08, rel=0.1)
    assert bench.axis.table_mass_kg == pytest.approx(truth.axis.table_mass_kg, rel=0.02)


@pytest.mark.long
def test_it_is_named_where_what_is_left_matters() -> None:
    owner, truth = stiff_owner()
    for terms in ((LOST,), ()):
        found = search(
            prepared(prepare_dataset([take(recorded(truth, *terms, torque_noise_n_m=NOISE_N_M), owner)], owner))
        )
        assert [term.effect for term in found.terms] == [term.effect for term in terms]


def test_of_one_spring_it_would_be_that_spring() -> None:
    owner = bench()
    run = take(recorded(owner), owner)
    mode = MechanismEntry(
        effect="structural_mode", parameters={"frequency_hz": 80.0, "damping_ratio": 0.05, "mass_ratio": 0.2}
    )
    for known in (owner, owner.model_copy(update={"mechanisms": (mode,)})):
        assert not may_hide(evaluated(Hypothesis(known), [run]))


def test_beside_a_lost_preload_and_without_a_linear_encoder_it_is_not_looked_for() -> None:
    owner = load_bench("reference_7dof")
    run = take(recorded(owner), owner)
    assert may_hide(evaluated(Hypothesis(owner), [run]))
    assert not may_hide(evaluated(Hypothesis(owner, (LOST,)), [run]))
    assert not may_hide(evaluated(Hypothesis(owner), [replace(run, table_m=np.zeros(0))]))


@pytest.mark.long
def test_where_a_screen_beside_the_refit_finds_nothing_the_owners_values_are_searched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A refit that nothing is found beside stands for those that lead astray: which do, depends on many digits."""
    owner = bench(table_mass_kg=300.0)
    pulled = Term("spring_load", 0, (6000.0, 0.02))
    run, plain = (take(recorded(bench(), *terms), owner) for terms in ((pulled,), ()))
    base = fit_nominal_parameters(prepare_dataset([run], owner))
    first = from_bench_file(base)[0]
    assert first.cost < 1.1 * base.rows < 0.1 * base.cost
    monkeypatch.setattr(next_term, "race", lambda base, candidates: [])
    (spring,) = search(prepared(prepare_dataset([run], owner))).terms
    assert spring.effect == "spring_load"
    assert spring.values == pytest.approx(pulled.values, rel=0.02)
    assert search(prepared(prepare_dataset([plain], owner))).terms == ()
