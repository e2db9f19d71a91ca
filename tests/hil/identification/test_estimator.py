"""The estimator against independent computations, how its fits end, and an unstable twin."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, recorded
from scipy.optimize import least_squares

from hil.errors import HilError
from hil.identification.estimator import Estimator, Fit, FitStatus
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.nominal_fit import require_finite
from hil.identification.residuals import Residuals
from hil.identification.terms import Term

OWNER = bench()
LOAD = Term("constant_load", 0, (0.3,))


@pytest.mark.parametrize(
    ("truth", "start"),
    [
        ((), ()),
        ((LOAD,), (Term("constant_load", 0, (0.05,)),)),
        ((Term("cogging_torque", 0, (0.1, 6.0, 0.4)),), (Term("cogging_torque", 0, (0.05, 6.02, 0.0)),)),
    ],
    ids=["nominal", "load", "cogging"],
)
def test_the_fit_finds_the_minimum_that_scipy_finds(truth: tuple[Term, ...], start: tuple[Term, ...]) -> None:
    estimator = Estimator(dataset([take(recorded(bench(coulomb_torque_n_m=1.2), *truth), OWNER)], OWNER))
    begun = Hypothesis(OWNER, start)
    found = estimator.fit(begun)
    reference = least_squares(
        lambda x: estimator.residuals(begun.moved(x)).vector, found.hypothesis.x, bounds=begun.bounds, x_scale="jac"
    )
    assert found.status is FitStatus.CONVERGED
    assert found.cost == pytest.approx(2.0 * reference.cost, rel=1e-4)
    assert found.cost < 1.1 * found.rows


def test_a_fit_says_how_it_ended() -> None:
    estimator = Estimator(dataset([take(recorded(bench(coulomb_torque_n_m=5.0)), OWNER)], OWNER))
    assert estimator.evaluate(Hypothesis(OWNER)).status is FitStatus.NOT_FITTED
    assert estimator.fit(Hypothesis(OWNER), evaluations=2).status is FitStatus.OUT_OF_STEPS
    bounded = estimator.fit(Hypothesis(OWNER), evaluations=60)  # 1.1 N m may be wrong by a factor of three
    assert bounded.status is FitStatus.PARAMETER_AT_BOUND
    assert "coulomb_torque_n_m" in bounded.at_bound


def test_an_unstable_twin_is_refused_in_one_sentence_and_its_weighted_residuals_stay_finite() -> None:
    data = dataset([take(recorded(OWNER), OWNER)], OWNER)
    residuals = Residuals(data, ({"torque": np.full(data.runs[0].motor.size, np.nan)},))
    found = Fit(Hypothesis(OWNER), residuals, np.zeros((data.rows, 0)), Estimator(data))
    with pytest.raises(HilError, match=r"twin of this axis is unstable at a period of 0\.001 s"):
        require_finite(found)
    assert np.isfinite(residuals.vector).all()
    assert np.isfinite(residuals.over_noise(0)["torque"]).all()
