"""The numerical core against independent computations: estimator, evidence, score test."""

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, fitted, recorded
from scipy.optimize import least_squares
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.diagnosis.search.initial_values import StartPoint
from hil.diagnosis.search.score_test import screen
from hil.errors import HilError
from hil.identification.estimator import Estimator, Fit, FitStatus
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import bic_gain
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


def test_evidence_of_a_useless_regressor_on_autoregressive_noise_is_rarely_positive() -> None:
    """One random regressor is fitted to noise of a correlation of 20 rows, 200 times over."""
    run = take(recorded(OWNER), OWNER)
    data = dataset([run], OWNER)
    rng, size = np.random.default_rng(1), run.motor[run.evaluated].size

    def fit_of(noise: FloatArray, parameters: int) -> Fit:
        channel = np.zeros(run.motor.size)
        channel[run.evaluated] = noise * run.noise.torque
        hypothesis = Hypothesis(OWNER).moved(np.zeros(parameters))
        return Fit(hypothesis, Residuals(data, ({"torque": channel},)), np.zeros((size, 0)), Estimator(data))

    evidence = []
    for _ in range(200):
        noise, regressor = (lfilter([1.0], [1.0, -0.95], rng.standard_normal(size)) for _ in range(2))
        left = noise - regressor * (regressor @ noise) / (regressor @ regressor)
        evidence.append(bic_gain(fit_of(left, 2), fit_of(noise, 1)))
    assert np.mean(np.array(evidence) > 0.0) < 0.1
    assert max(evidence) < 10.0


def test_the_score_test_finds_a_known_direction_and_its_strength() -> None:
    """The nominal parameters are right, so that the residual is noise and the effect of a small load."""
    load = Term("constant_load", 0, (0.05,))
    data = dataset([take(recorded(OWNER, load), OWNER)], OWNER)
    base = fitted(Hypothesis(OWNER), data, evaluations=1)  # its derivatives, no step
    points = [StartPoint("constant_load", 0, (0.02,)), StartPoint("encoder_eccentricity", 0, (1e-4, 0.0), 0, 1)]
    first, second = screen(base, points)
    assert first.term.effect == "constant_load"
    assert first.term.values[0] == pytest.approx(0.05, rel=0.1)
    assert first.share > 10.0 * second.share


def test_another_scale_of_the_coordinates_changes_no_residual() -> None:
    """Terms are started at 0.05 N m and 200 us and moved away from there; then they are scaled by their values."""
    data = dataset([take(recorded(OWNER, LOAD), OWNER)], OWNER)
    terms = (Term("constant_load", 0, (0.05,)), Term("current_loop_lag", 0, (2e-4,)))
    start = Hypothesis(OWNER, terms)
    moved = start.moved(start.x + 0.3)
    assert moved.rebased.values == pytest.approx(moved.values)
    np.testing.assert_allclose(moved.rebased.residuals(data).vector, moved.residuals(data).vector, atol=1e-6)
    assert moved.without(0).values == pytest.approx([*moved.values[: moved.nominal_count], moved.values[-1]])
    assert moved.with_term(Term("backlash", 0, (3e-6,))).without(2).values == moved.values


def test_an_unstable_twin_is_refused_in_one_sentence_and_its_weighted_residuals_stay_finite() -> None:
    data = dataset([take(recorded(OWNER), OWNER)], OWNER)
    residuals = Residuals(data, ({"torque": np.full(data.runs[0].motor.size, np.nan)},))
    found = Fit(Hypothesis(OWNER), residuals, np.zeros((data.rows, 0)), Estimator(data))
    with pytest.raises(HilError, match=r"twin of this axis is unstable at a period of 0\.001 s"):
        require_finite(found)
    assert np.isfinite(residuals.vector).all()
    assert np.isfinite(residuals.over_noise(0)["torque"]).all()
