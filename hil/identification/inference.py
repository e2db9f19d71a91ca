"""Evidence between hypotheses with coloured residuals, and standard errors of fitted parameters.

    BIC difference = sum over parts of  n log(E_worse / E_better)  -  (k_better - k_worse) log n   (Schwarz 1978)

A part is one channel of one run; E is the energy of its residual behind a whitening filter, the
autoregressive model (Box and Jenkins 1970) of the better hypothesis' residual. So correlated rows are not counted as
independent, and a small ripple is weighted by the residual density at its frequency. The noise level of a part is
estimated from the residual of the better hypothesis.
"""

import math
from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import correlate, fftconvolve, lfilter

from hil.arrays import FloatArray
from hil.identification.estimator import Fit
from hil.identification.residuals import Residuals

Filter = FloatArray

_ORDER = 24  # of the autoregressive model: 24 ms at 1 kHz, the period of the slowest control resonance
# Added to each energy per row, in units of noise^2: differences below a tenth of the noise in rms carry no evidence.
_BLUR = 0.01
TIED = 10.0  # BIC difference: a rival closer than this is not refuted. "Very strong" evidence (Kass and Raftery 1995)
# Difference in energy per row, in units of noise^2, up to which a rival is not refuted, whatever the evidence: 7 % of
# the noise in rms. The model discrepancy of two simulations of one axis is as large.
ALIKE = 0.005
_SOKAL = 5.0  # window of the autocorrelation sum in correlation times (Sokal 1997)


def whitening(fit: Fit) -> list[Filter]:
    """Prediction-error filters (order + 1,), first coefficient 1, of each part of a fit's residuals."""
    return [_prediction_error_filter(part) for part in fit.residuals.parts.values()]


def _prediction_error_filter(part: FloatArray) -> Filter:
    """Solve the Yule-Walker equations with `_BLUR` added to the variance: a residual of zeros gives the filter 1."""
    centred = part - part.mean()
    covariance = correlate(centred, centred, method="fft")[part.size - 1 : part.size + _ORDER] / part.size
    covariance[0] += _BLUR
    return np.concatenate([[1.0], -np.asarray(solve_toeplitz(covariance[:-1], covariance[1:]), dtype=np.float64)])


def whitened(values: FloatArray, splits: Sequence[int], filters: Sequence[Filter]) -> FloatArray:
    """Filter values (m,) or (m, k) part by part."""
    filtered = np.empty_like(values)
    for (begin, end), taps in zip(pairwise((0, *splits, len(values))), filters, strict=True):
        filtered[begin:end] = lfilter(taps, [1.0], values[begin:end], axis=0)
    return filtered


def bic_gain(better: Fit, worse: Fit, filters: Sequence[Filter] | None = None) -> float:
    """Return BIC(worse) - BIC(better); > 0 favours `better`. `filters`: by default those of `better`.

    It is the larger of two values: on plain residuals with their number of independent rows, sensitive to slow
    differences, and on whitened residuals, sensitive to small fast ones.
    """
    more = better.hypothesis.free - worse.hypothesis.free
    plain = by_energy(better, worse)
    white = 0.0
    for taps, a, b in zip(
        whitening(better) if filters is None else filters,
        better.residuals.parts.values(),
        worse.residuals.parts.values(),
        strict=True,
    ):
        blur = _BLUR * a.size
        left, right = lfilter(taps, [1.0], a), lfilter(taps, [1.0], b)
        white += a.size * np.log((float(right @ right) + blur) / (float(left @ left) + blur))
    return float(max(plain, white - more * np.log(better.rows)))


def bic_margin(named: Fit, rival: Fit, filters: Sequence[Filter] | None = None) -> float:
    """Return BIC(rival) - BIC(named); < 0 favours the rival. `filters`: by default those of `named`.

    Both residuals are whitened by the filter of the fit with less cost: that of the other would hide what it leaves.
    """
    return bic_gain(named, rival, filters) if named.cost <= rival.cost else -bic_gain(rival, named)


def by_energy(better: Fit, worse: Fit) -> float:
    """BIC(worse) - BIC(better) on plain residuals with their number of independent rows.

    Of a residual that the model's own faults colour, few rows are independent: two forms of one effect are then told
    apart only by a clear difference in energy.
    """
    more = better.hypothesis.free - worse.hypothesis.free
    evidence = rows = 0.0
    for a, b in zip(better.residuals.parts.values(), worse.residuals.parts.values(), strict=True):
        own, blur = a.size / correlation_time(a), _BLUR * a.size
        evidence += own * np.log((float(b @ b) + blur) / (float(a @ a) + blur))
        rows += own
    return float(evidence - more * np.log(rows))


def refuted(evidence: float, more: float) -> bool:
    """True if a hypothesis falls behind another by this evidence (BIC difference) and this energy per row [noise^2]."""
    return evidence >= TIED and more >= ALIKE


def correlation_time(residual: FloatArray) -> float:
    """Integrated autocorrelation time of a residual (n,), in rows (Sokal 1997): 1 where it is white."""
    n = residual.size
    energy = float(residual @ residual)
    if energy == 0.0:
        return 1.0
    correlation = correlate(residual, residual, method="fft")[n - 1 : n - 1 + n // 2] / energy
    total = 2.0 * np.cumsum(correlation) - 1.0
    enough = np.flatnonzero(np.arange(total.size) >= _SOKAL * total)
    return float(max(total[enough[0]] if enough.size else total[-1], 1.0))


# Factor for the model discrepancy: on development cases (seeds 931 and 941 of the proof's generator, 67 parameters)
# 90 % of the errors are below 3.5 standard errors of the noise alone, 2.1 times the 1.645 of a normal distribution.
_WIDENED = 2.1
_LEAST = 0.01  # least standard error in steps of the forward difference, which resolves no less
_BLOCK_ROWS = 200  # longer than the correlation of residuals: 0.2 s at 1 kHz


def _with_covariance(part: FloatArray, columns: FloatArray) -> FloatArray:
    """Columns (n, p) multiplied by the covariance (n, n) of a residual (n,), up to `_SOKAL` correlation times."""
    lags = min(int(_SOKAL * correlation_time(part)) + 1, part.size)
    covariance = correlate(part, part, method="fft")[part.size - 1 : part.size - 1 + lags] / part.size
    covariance = covariance * (1.0 - np.arange(lags) / lags)
    kernel = np.concatenate([covariance[:0:-1], covariance])
    return np.asarray(fftconvolve(columns, kernel[:, None], mode="full", axes=0)[lags - 1 :][: part.size])


def sandwich(slopes: FloatArray, residuals: Residuals) -> FloatArray:
    """Standard errors (k,) by the equation of `standard_errors` of k values with derivatives (m, k), without bounds."""
    return _largest(_covariances(slopes, residuals))


def _covariances(slopes: FloatArray, residuals: Residuals) -> list[FloatArray]:
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0.0] = 1.0
    slope = slopes / scale
    inverse = np.linalg.pinv(slope.T @ slope, hermitian=True)
    ends = (0, *residuals.splits, residuals.vector.size)
    starts = np.concatenate([np.arange(begin, end, _BLOCK_ROWS) for begin, end in pairwise(ends)])
    score = np.add.reduceat(slope * residuals.vector[:, None], starts, axis=0)
    left = np.zeros_like(inverse)
    for part, own in zip(residuals.parts.values(), np.split(slope, residuals.splits), strict=True):
        left += own.T @ _with_covariance(part, own)
    size = np.outer(scale, scale) / _WIDENED**2
    return [inverse @ middle @ inverse / size for middle in (score.T @ score, left)]


def _largest(covariances: Sequence[FloatArray]) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum.reduce([np.maximum(np.diag(one), 0.0) for one in covariances])))


def _within(covariance: FloatArray, width: FloatArray) -> FloatArray:
    """Covariance (k, k) given that the first parameters lie within bounds `width` (n,) apart.

    The bounds count as an independent measurement with the variance of a uniform distribution, width^2 / 12.
    """
    number, known = width.size, np.maximum(width, 1e-12) / math.sqrt(12.0)
    if not number:
        return covariance
    gain = covariance[:, :number] / known
    both = covariance[:number, :number] / np.outer(known, known) + np.eye(number)
    return np.asarray(covariance - gain @ np.linalg.solve(both, gain.T), dtype=np.float64)


def standard_errors(fit: Fit, known: Collection[int] = ()) -> list[float]:
    """Standard error of each physical parameter, robust against coloured residuals (sandwich estimator):

        A^-1 B A^-1,   A = J^T J
        B = sum over blocks of g g^T,   g = J^T r of a block                           (Liang and Zeger 1986)
        B = sum over parts of  J^T C J,   C: autocovariance of the residual                     (Newey and West 1987)

    the larger of both, multiplied by `_WIDENED`. The second holds for residuals that are correlated over more than a
    block. Nominal parameters lie within their bounds: what is told only together with one, as a delay with that of the
    recorded torque, is told to within these. A controller replayed bit-identically leaves no noise; then the error is
    1/100 of the step of the forward difference. The parameters of the indices `known` count as given.
    """
    hypothesis = fit.hypothesis
    low, high = hypothesis.bounds
    open_ = np.array([index not in known for index in range(low.size)])
    width = (high - low)[: hypothesis.nominal_count][open_[: hypothesis.nominal_count]]
    errors = np.zeros(low.size)
    errors[open_] = _largest([_within(one, width) for one in _covariances(fit.jacobian[:, open_], fit.residuals)])
    steps = fit.estimator.steps(hypothesis)
    return [
        float(max(error, _LEAST * step) * (abs(value) if coordinate.logarithmic else abs(coordinate.scale)))
        for error, step, value, coordinate in zip(errors, steps, hypothesis.values, hypothesis.coordinates, strict=True)
    ]
