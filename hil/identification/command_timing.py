"""Instants at which a held torque command changes, as the motion answers them.

Rows of an imported file leave open when the torque changed between two of them: `Measured.torque_gap` takes any instant
for equally likely. A command that is held over many rows changes at single instants, and each answer of the motor tells
its own. If all changes stand at one place between the rows, a delay common to all describes them, and little of that
variance is real:

    x[k+1] - 2 x[k] + x[k-1] = sum_j b_j u[k-j] + c v + d sign(v) + e + r,    var r = s^2 (T^2 / J)^2 g^2 + const

with g the standard deviation of the unknown mean torque of the two periods about row k. The share s is estimated from
the squared r over g^2; what the model lacks only makes it larger.
"""

import numpy as np

from hil.arrays import FloatArray

HELD = 0.5  # share of the moving rows with an unchanged command: a feedback of a moving encoder changes at each count
_LAGS = 9  # rows of the command from one ahead on: the answer of a second inertia to a step begins within them
_LEAST_ROWS = 200  # a slope over squared residuals needs many more rows than the regression has columns
_SURE = 2.0  # standard errors added to the estimated variance: the share is an upper bound


def is_held(command: FloatArray, motor: FloatArray) -> bool:
    """True if a command (n,) stays the same from row to row over most of the motion (n,)."""
    moves = np.diff(motor) != 0.0
    return bool(moves.any() and np.mean(np.diff(command)[moves] == 0.0) > HELD)


def unknown_share(
    command: FloatArray, motor: FloatArray, unknown: FloatArray, period_s: float, inertia: float
) -> float:
    """Upper bound, at most 1, of the share of the `unknown` torque (n,) that the motion shows; 1 if it cannot tell.

    `command`, `motor` (n,) and `inertia` in motor units; `unknown` is the standard deviation of the mean torque from a
    row to the next one.
    """
    rows = np.arange(_LAGS, motor.size - 2)
    if rows.size < _LEAST_ROWS or not is_held(command, motor):
        return 1.0
    curvature = motor[rows + 1] - 2.0 * motor[rows] + motor[rows - 1]
    velocity = 0.5 * (motor[rows + 1] - motor[rows - 1])
    lagged = [command[rows + 1 - lag] for lag in range(_LAGS)]
    columns = np.column_stack([*lagged, velocity, np.sign(velocity), np.ones(rows.size)])
    left = curvature - columns @ np.linalg.lstsq(columns, curvature, rcond=None)[0]
    # half of each period's mean torque acts on a second difference
    variance = (period_s**2 / inertia) ** 2 * 0.25 * (unknown[rows] ** 2 + unknown[rows - 1] ** 2)
    spread = variance - variance.mean()
    size = float(spread @ spread)
    if size == 0.0:
        return 1.0
    slope = float(spread @ left**2) / size
    scatter = left**2 - np.mean(left**2) - slope * spread
    error = float(np.sqrt(np.sum((spread * scatter) ** 2))) / size  # of rows of unequal scatter (White 1980)
    return float(np.sqrt(np.clip(slope + _SURE * error, 0.0, 1.0)))
