"""Whole rows by which a torque is recorded before or after its motion, where these are more than one.

About a reversal a late torque is still that of the other way, so that a fit which takes it for the present one finds
another lateness. Compared are the residuals of the plain model at each shift, on rows that are farther from a reversal.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

_RESOLVED = 1e-3  # of the torque: what leaves less is as good
_CLEAR = 20.0  # evidence for a shift (BIC difference)


def shift_of_torque(
    torques: Sequence[FloatArray],
    tables: Sequence[FloatArray],
    rows: Sequence[NDArray[np.intp]],
    shifts: range,
    samples: float,
) -> int:
    """The shift, of those tried, with which regressors (n, k) explain torques (n,) best at rows (m,); 0 without one.

    Positive: the torque is recorded before its motion. `samples`: independent ones of white noise in all rows.
    """
    torque = np.concatenate([own[at] for own, at in zip(torques, rows, strict=True)])

    def left(early: int) -> FloatArray:
        table = np.concatenate(
            [own[np.clip(at + early, 0, len(own) - 1)] for own, at in zip(tables, rows, strict=True)]
        )
        table = table / np.maximum(np.linalg.norm(table, axis=0), 1e-300)
        return np.asarray(torque - table @ np.linalg.lstsq(table, torque, rcond=1e-9)[0])

    least = max(_RESOLVED**2 * float(torque @ torque), 1e-300)
    tried = {early: max(float(np.sum(left(early) ** 2)), least) for early in shifts}
    best = min(tried, key=lambda early: tried[early])
    near, rest = min(value for early, value in tried.items() if abs(early) <= shifts.step), left(best)
    alike = max(float(rest[1:] @ rest[:-1]) / max(float(rest @ rest), 1e-300), 0.0)  # from one row to the next
    clear = samples * (1.0 - alike) / (1.0 + alike) * float(np.log(near / tried[best])) > _CLEAR
    inside = shifts.step < abs(best) <= shifts[-1] - shifts.step
    return best if inside and clear else 0
