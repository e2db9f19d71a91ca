"""Starting points of the race: parameters of the bench file beside the refitted ones."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, recorded

from hil.bench.bench_file import load_bench
from hil.diagnosis.preparation.preflight import preflight
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.successive_halving import _Race, _soft, given_points, race
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
    everything, hidden = (base.hypothesis.moved(x) for x in given_points(base))
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
    assert len(given_points(bent(Hypothesis(load_bench("emps_symmetric"), ())))) == 1


def test_a_start_is_compared_beside_the_parameters_that_the_mismatch_has_bent() -> None:
    """Friction that falls as the axis warms up bends the fitted friction: beside it a start at the truth costs more."""
    truth, drift = bench(), Term("friction_drift", 0, (-0.5, 1.5))
    data = prepare_dataset(preflight([recorded(truth, drift, times=2)], truth).accepted(), truth)
    base = fit_nominal_parameters(data)
    weak = Term("friction_drift", 0, (0.01, 1.5))
    contest = _Race(base, [Candidate(drift, 0.5, (weak,))])
    begun = contest._least(contest.candidates[0], base.hypothesis.x, _soft, contest._cost_beside_base)
    assert [fit.terms for fit in begun] == [(weak,), (drift,)]


def test_a_candidate_whose_shape_alone_speaks_for_it_is_fitted() -> None:
    """Below the noise the clearest shape may explain nothing at its start."""
    truth, load = bench(), Term("constant_load", 0, (0.4,))
    data = prepare_dataset(preflight([recorded(truth, load)], truth).accepted(), truth)
    (found,) = race(fit_nominal_parameters(data), [Candidate(load, 0.0, ())])
    assert found.terms[0].effect == "constant_load"


def test_a_fit_that_leaves_more_than_its_start_begins_there_again() -> None:
    """A small effect far below the fit's own steps: few evaluations led the parameters of the base away."""
    truth, load = bench(), Term("constant_load", 0, (0.4,))
    data = prepare_dataset(preflight([recorded(truth, load)], truth).accepted(), truth)
    base = fit_nominal_parameters(data)
    contest = _Race(base, [Candidate(load, 0.5)])
    astray = base.estimator.evaluate(base.hypothesis.with_term(Term("constant_load", 0, (-0.4,))))
    found = contest._from_start(astray)
    assert found.cost < 0.5 * base.cost < astray.cost
    assert found.terms[0].values[0] == pytest.approx(0.4, rel=0.1)
    assert contest._from_start(found) is found
