"""Evidence for one hypothesis against another, with noise that is not white.

    BIC difference = N_eff log(cost_a / cost_b) + (k_a - k_b) log N_eff          (Schwarz 1978)

The number of rows overstates what was seen when residuals are correlated: N_eff divides it by the integrated
autocorrelation time (Sokal 1997). The noise level is not taken as known: what the better hypothesis
leaves is the yardstick, so that in a recording that nothing explains fully, small gains count little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.diagnosis.fit import Fit

FloatArray = NDArray[np.float64]

_WINDOW = 5.0        # Sokal's window: sum to the lag that is so many correlation times


def correlation_time(residual: FloatArray) -> float:
    """Integrated autocorrelation time of a residual (n,), in rows: 1 where it is white."""
    n = residual.size
    energy = float(residual @ residual)
    if energy == 0.0:
        return 1.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(residual, size)) ** 2
    correlation = np.fft.irfft(spectrum, size)[: n // 2] / energy
    total = 2.0 * np.cumsum(correlation) - 1.0
    enough = np.flatnonzero(np.arange(total.size) >= _WINDOW * total)
    return float(max(total[enough[0]] if enough.size else total[-1], 1.0))


def effective_samples(fit: Fit) -> float:
    """N_eff of a fit's residuals: each channel's rows over its correlation time, weighted by its energy."""
    weight = total = 0.0
    for part in np.split(fit.residuals, fit.splits):
        energy = float(part @ part)
        weight += energy * part.size / correlation_time(part)
        total += energy
    return weight / max(total, 1e-300) * len(fit.splits) + 1.0


def against(better: Fit, worse: Fit, samples: float | None = None) -> float:
    """BIC difference: positive where `better` deserves its name. `samples`: N_eff, by default that of `better`."""
    n = effective_samples(better) if samples is None else samples
    return float(n * np.log(worse.cost / better.cost) - (better.x.size - worse.x.size) * np.log(n))
