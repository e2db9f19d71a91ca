"""Evidence for one hypothesis against another, with noise that is not white.

    BIC difference = sum over parts of  n log(E_worse / E_better)  -  (k_better - k_worse) log n   (Schwarz 1978)

A part is one channel of one run; E is the energy of its residual behind a whitening filter, the
autoregressive model (Box and Jenkins 1970) of what the better hypothesis leaves over. So correlated rows do not count
as independent ones, and a faint ripple counts at the frequencies where little else is left. The noise
level of a part is not taken as known: what the better hypothesis leaves is the yardstick.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import Fit

Filter = FloatArray

_ORDER = 24  # of the autoregressive model: 24 ms at 1 kHz, the period of the slowest control resonance
# What is added to each energy, per row, in units of noise^2: a tenth of the noise is not told apart.
_BLUR = 0.01
_SOKAL = 5.0  # correlations are summed up to the lag that is so many correlation times


def whitening(found: Fit) -> list[Filter]:
    """Prediction-error filters (order + 1,), first coefficient 1, of each part of a fit's residuals."""
    return [_prediction_error_filter(part) for part in np.split(found.residuals, found.splits)]


def _prediction_error_filter(part: FloatArray) -> Filter:
    """Yule-Walker, with the blur added to the variance: an empty residual gives the filter 1."""
    centred = part - part.mean()
    size = 1 << (2 * part.size - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    covariance = np.fft.irfft(spectrum, size)[: _ORDER + 1] / part.size
    covariance[0] += _BLUR
    return np.concatenate([[1.0], -np.asarray(solve_toeplitz(covariance[:-1], covariance[1:]), dtype=np.float64)])


def whitened(values: FloatArray, splits: Sequence[int], filters: Sequence[Filter]) -> FloatArray:
    """Values (m,) or (m, k), filtered part by part."""
    parts = [
        np.asarray(lfilter(taps, [1.0], part, axis=0), dtype=np.float64)
        for part, taps in zip(np.split(values, list(splits)), filters, strict=True)
    ]
    return np.concatenate(parts)


def against(better: Fit, worse: Fit, filters: Sequence[Filter] | None = None) -> float:
    """BIC difference: positive where `better` deserves its name. `filters`: by default those of `better`.

    Taken on the residuals as they are, with as many rows as are independent, and whitened; the clearer of the two
    counts: the first sees what is slow, the second what is faint and fast.
    """
    more = better.x.size - worse.x.size
    rows = effective_samples(better)
    plain = rows * np.log(worse.cost / better.cost) - more * np.log(rows)
    white = 0.0
    for taps, a, b in zip(
        whitening(better) if filters is None else filters,
        np.split(better.residuals, better.splits),
        np.split(worse.residuals, worse.splits),
        strict=True,
    ):
        blur = _BLUR * a.size
        left, right = lfilter(taps, [1.0], a), lfilter(taps, [1.0], b)
        white += a.size * np.log((float(right @ right) + blur) / (float(left @ left) + blur))
    return float(max(plain, white - more * np.log(better.residuals.size)))


def correlation_time(residual: FloatArray) -> float:
    """Integrated autocorrelation time of a residual (n,), in rows (Sokal 1997): 1 where it is white."""
    n = residual.size
    energy = float(residual @ residual)
    if energy == 0.0:
        return 1.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(residual, size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: n // 2] / energy
    total = 2.0 * np.cumsum(correlation) - 1.0
    enough = np.flatnonzero(np.arange(total.size) >= _SOKAL * total)
    return float(max(total[enough[0]] if enough.size else total[-1], 1.0))


def effective_samples(fit: Fit) -> float:
    """Independent rows of a fit's residuals: rows of each part over its correlation time, weighted by energy."""
    weight = total = 0.0
    parts = np.split(fit.residuals, fit.splits)
    for part in parts:
        energy = float(part @ part)
        weight += energy * part.size / correlation_time(part)
        total += energy
    return weight / max(total, 1e-300) * len(parts) + 1.0
