"""Residual tests of a grey-box fit, as `resid` of MATLAB's System Identification Toolbox: correlation of the residuals
with the inputs.

    corr(e, z_j) = sum e z_j / (|e| |z_j|),   variance  1/n sum over lags l of  r_e(l) r_z(l)          (Bartlett 1946)

It uses the diagnosis's own twin with fitted nominal parameters, motor side and transmission separately, so that each
prediction error belongs to one block; controller and drive, which have no fitted parameters; and as inputs the terms
of `peers.regressors`. Correlations within the joint 99 % bounds of a case, or below the materiality limit of the
diagnosis, are no mismatch. Otherwise the term that explains most energy of a residual names the effect. Whiteness is
not tested, since quantisation noise is not white.
"""

from typing import Any

import numpy as np
from scipy.signal import correlate
from scipy.stats import norm

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.identification.measured import Measured
from hil.validation.proof.peers.case import PeerCase
from hil.validation.proof.peers.regressors import Equation, equations

_LEVEL = 0.99  # of all tests of a case
_LAGS = 200  # rows, longest correlation
_CHANNELS = {"motor": "motor", "transmission": "table"}


def residual_tests(case: PeerCase) -> dict[str, Any]:
    """Return the answer of the residual tests to a case."""
    found = equations(case, case.train, residuals=lambda run: _prediction_errors(case, run))
    count = sum(equation.terms.shape[1] for equation in found)
    bound = float(norm.ppf(1.0 - 0.5 * (1.0 - _LEVEL) / count))
    best = max((outside for equation in found for outside in _outside(equation, bound)), default=None)
    return case.answer([best[1]] if best else [])


def _prediction_errors(case: PeerCase, run: Measured) -> dict[str, FloatArray]:
    """Return the errors of the refitted twin's motor and transmission in units of noise, with the sign of a torque."""
    errors = case.nominal.residuals.over_noise(case.nominal.data.runs.index(run))
    errors["motor"] *= -1.0
    return {block: errors[channel] for block, channel in _CHANNELS.items() if channel in errors}


def _outside(equation: Equation, bound: float) -> list[tuple[float, str]]:
    """Return energy and effect of each term with a correlation beyond its bound, given in standard deviations."""
    error = equation.target
    memory = _autocorrelation(error)
    found = []
    for j, (positive, negative) in enumerate(equation.effects):
        term = equation.terms[:, j]
        size = float(np.sqrt((error @ error) * (term @ term)))
        if size == 0.0:
            continue
        correlation = float(error @ term) / size
        products = memory * _autocorrelation(term)
        variance = max(float(products[0] + 2.0 * products[1:].sum()), 1.0) / error.size
        energy = correlation**2 * float(np.mean(error**2)) / equation.noise**2
        if abs(correlation) > bound * variance**0.5 and energy > CRITERIA.material:
            found.append((energy, (negative if correlation < 0.0 else positive)[0]))
    return found


def _autocorrelation(values: FloatArray) -> FloatArray:
    """Return the autocorrelation of lags 0 to _LAGS, 1 at lag 0."""
    products = correlate(values, values, method="fft")[values.size - 1 :][: _LAGS + 1]
    return np.asarray(products / max(products[0], 1e-300), dtype=np.float64)
