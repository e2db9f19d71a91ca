"""Standard errors, and the evidence (BIC) for one fit against another."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, changed, dataset, fitted, recorded
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.identification.estimator import Estimator, Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import _within, bic_gain, bic_margin, standard_errors
from hil.identification.measured import take
from hil.identification.residuals import Residuals
from hil.identification.terms import Term

OWNER = bench()
LOAD, OTHER = Term("constant_load", 0, (0.4,)), Term("friction_gradient", 0, (0.3,))


def test_evidence_is_on_the_side_of_the_fit_with_less_cost() -> None:
    data = dataset([take(recorded(OWNER, LOAD), OWNER)], OWNER)
    right, wrong = (fitted(Hypothesis(OWNER, (term,)), data, evaluations=4) for term in (LOAD, OTHER))
    assert bic_margin(right, wrong) == bic_gain(right, wrong) > 0.0
    assert bic_margin(wrong, right) == -bic_margin(right, wrong)


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


def test_standard_errors_count_what_the_model_leaves_with_its_correlation() -> None:
    """A torque of 0.05 N m that wanders within seconds is no load: few errors are above three standard errors."""
    ratios = []
    for seed in range(8):
        recording = recorded(OWNER, seed=seed, times=2)
        keeps = np.exp(-1e-3)  # over a row of 1 ms
        steps = np.random.default_rng(seed).normal(0.0, 1.0, len(recording) + 5000)
        wander = 0.05 * np.sqrt(1.0 - keeps**2) * lfilter([1.0], [1.0, -keeps], steps)[5000:]
        torque = recording["torque_n_m"] + wander
        data = dataset([take(changed(recording, torque_n_m=torque, torque_command_n_m=torque), OWNER)], OWNER)
        found = fitted(Hypothesis(OWNER, (Term("constant_load", 0, (0.01,)),)), data)
        ratios.append(abs(found.terms[0].values[0]) / standard_errors(found)[found.hypothesis.columns(0)][0])
    assert sum(ratio < 3.0 for ratio in ratios) >= 7


def test_bounds_of_a_nominal_parameter_tell_what_is_confounded_with_it() -> None:
    """Only the sum of two values is known, to 0.1; the first lies within bounds 1.2 apart."""
    known, width = 0.1, 1.2
    unknown = 1e4
    covariance = np.array([[unknown, -unknown], [-unknown, unknown + known**2]])
    within = _within(covariance, np.array([width]))
    assert within[0, 0] == pytest.approx(width**2 / 12.0, rel=1e-4)
    assert within[1, 1] == pytest.approx(width**2 / 12.0 + known**2, rel=1e-4)
    precise = np.diag([1e-6, 2e-6])
    assert _within(precise, np.array([width])) == pytest.approx(precise, rel=1e-4, abs=1e-12)
    assert np.array_equal(_within(precise, np.zeros(0)), precise)
