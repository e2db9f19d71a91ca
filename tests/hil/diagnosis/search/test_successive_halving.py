"""Starting points of the search: parameters of the bench file beside the refitted ones, and play on a light nut."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, recorded

from hil.bench.bench_file import load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.preparation.preflight import preflight
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.successive_halving import _Race, _soft, owner_points
from hil.identification.coordinates import CHATTER_STEP, LAST_EDGE_STEP_S
from hil.identification.dataset import prepare_dataset
from hil.identification.estimator import Estimator, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.residual_scales import inertia
from hil.identification.residuals import Residuals
from hil.identification.terms import Term


def bent(hypothesis: Hypothesis, **factors: float) -> Fit:
    """A fit that has multiplied nominal values."""
    x = hypothesis.x.copy()
    for index, coordinate in enumerate(hypothesis.coordinates[: hypothesis.nominal_count]):
        x[index] += np.log(factors.get(coordinate.name, 1.0))
    data = dataset([], hypothesis.bench)
    return Fit(hypothesis.moved(x), Residuals(data, ()), np.zeros((1, 0)), Estimator(data))


def test_springs_and_shares_of_the_masses_are_the_owners_and_the_rest_is_refitted() -> None:
    owner = load_bench("reference_7dof")
    term = Term("cogging_torque", 0, (0.1, 6.0, 0.2))
    base = bent(
        Hypothesis(owner, (term,)),
        motor_inertia_kg_m2=2.0,
        table_mass_kg=0.5,
        nut_support_stiffness_n_m=0.4,
        damping_ratio=5.0,
        coulomb_torque_n_m=1.2,
    )
    everything, hidden = (base.hypothesis.moved(x) for x in owner_points(base))
    refitted, terms = hidden.resolved
    assert everything.resolved.bench.axis == owner.axis
    assert inertia(refitted) == pytest.approx(inertia(base.bench))
    axis = refitted.axis
    assert axis.motor_inertia_kg_m2 / owner.axis.motor_inertia_kg_m2 == pytest.approx(
        axis.table_mass_kg / owner.axis.table_mass_kg
    )
    assert axis.nut_support_stiffness_n_m == pytest.approx(owner.axis.nut_support_stiffness_n_m)
    assert axis.damping_ratio == pytest.approx(owner.axis.damping_ratio)
    assert axis.coulomb_torque_n_m == pytest.approx(1.2 * owner.axis.coulomb_torque_n_m)
    assert terms[0].values == pytest.approx(term.values)


def test_without_springs_there_is_one_such_point() -> None:
    assert len(owner_points(bent(Hypothesis(load_bench("emps_symmetric"), ())))) == 1


def test_differences_are_wide_where_a_nut_may_chatter() -> None:
    owner = load_bench("reference_7dof")
    plain = Hypothesis(owner).steps(0.1, 20.0, LAST_EDGE_STEP_S)
    loose = Hypothesis(owner, (Term("backlash", 0, (4e-6,)),)).steps(0.1, 20.0, LAST_EDGE_STEP_S)
    assert plain.max() < CHATTER_STEP
    assert np.all(loose[: plain.size] == CHATTER_STEP)


def test_play_on_a_light_nut_beside_wrong_springs() -> None:
    """The nut of the 7-dof chain chatters in 5 um; the owner's spring is too stiff, the table too light."""
    owner = load_bench("reference_7dof")
    axis = owner.axis
    true = {
        "nut_support_stiffness_n_m": 0.75 * axis.nut_support_stiffness_n_m,
        "table_mass_kg": 1.2 * axis.table_mass_kg,
    }
    truth = owner.model_copy(update={"axis": axis.model_copy(update=true)})
    play = Term("backlash", 1, (5e-6,))
    found = diagnose([recorded(truth, play, times=2)], [recorded(truth, play, seed=2)], owner)
    assert [one.effect for one in found.result.missing] == ["backlash"]
    assert found.result.missing[0].parameters["gap_m"].value == pytest.approx(5e-6, rel=0.05)


def test_a_start_is_compared_beside_the_parameters_that_the_mismatch_has_bent() -> None:
    """Friction that falls as the axis warms up bends the fitted friction: beside it a start at the truth costs more."""
    truth, drift = bench(), Term("friction_drift", 0, (-0.5, 1.5))
    data = prepare_dataset(preflight([recorded(truth, drift, times=2)], truth).accepted(), truth)
    base = fit_nominal_parameters(data)
    weak = Term("friction_drift", 0, (0.01, 1.5))
    contest = _Race(base, [Candidate(drift, 0.5, (weak,))])
    begun = contest._least(contest.candidates[0], base.hypothesis.x, _soft, contest._cost_beside_base)
    assert [fit.terms for fit in begun] == [(weak,), (drift,)]
