"""Residual tests of a grey-box fit, as `resid` of MATLAB's System Identification Toolbox has them: is what the fit
leaves correlated with what goes into the system?

    corr(e, z_j) = sum e z_j / (|e| |z_j|),   variance  1/n sum over lags l of  r_e(l) r_z(l)          (Bartlett 1946)

It is given the diagnosis's own twin with its nominal parameters fitted, motor side and transmission each by themselves,
so that a prediction error speaks of one block alone; controller and drive, which have no parameters to fit; and as
inputs the terms of `hil.proof.peers.regressors`. Within the bounds of 99 %, for all tests of a case together, there is
no mismatch, nor does what the diagnosis would not call material count. Else the term that takes most energy of a
residual away names the effect. Whiteness is not asked for: encoders count, which is not white.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from hil.arrays import FloatArray
from hil.diagnosis.search.forward_selection import MATERIAL
from hil.identification.dataset import Measured
from hil.proof.peers.case import Answer, Case
from hil.proof.peers.regressors import Equation, equations

_LEVEL = 0.99  # of all tests of a case
_LAGS = 200  # rows, up to which a signal remembers
_CHANNELS = {"motor": "motor", "transmission": "table"}


def residual_tests(case: Case) -> Answer:
    """The answer of the residual tests about a case."""
    found = equations(case, case.train, residuals=lambda run: _prediction_errors(case, run))
    count = sum(equation.terms.shape[1] for equation in found)
    bound = float(norm.ppf(1.0 - 0.5 * (1.0 - _LEVEL) / count))
    best = max((outside for equation in found for outside in _outside(equation, bound)), default=None)
    return case.answer([best[1]] if best else [])


def _prediction_errors(case: Case, run: Measured) -> dict[str, FloatArray]:
    """Of the refitted twin's motor and transmission, in units of noise. A motor that is behind lacks torque."""
    errors = case.nominal.residuals.over_noise(case.nominal.data.runs.index(run))
    errors["motor"] *= -1.0
    return {block: errors[channel] for block, channel in _CHANNELS.items() if channel in errors}


def _outside(equation: Equation, bound: float) -> list[tuple[float, str]]:
    """Energy and effect of each term whose correlation is beyond its bound, given in standard deviations."""
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
        if abs(correlation) > bound * variance**0.5 and energy > MATERIAL:
            found.append((energy, (negative if correlation < 0.0 else positive)[0]))
    return found


def _autocorrelation(values: FloatArray) -> FloatArray:
    """Of lags 0 to _LAGS."""
    size = 1 << (2 * values.size - 1).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2, size)[: _LAGS + 1]
    return np.asarray(products / max(products[0], 1e-300), dtype=np.float64)
