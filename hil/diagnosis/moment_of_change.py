"""Change of a coefficient of the plain model over time in what a twin leaves of the torque.

    y = A b + a d 1(t >= t1) + e,    t1 and a, a column of A, where the sum of squares of e is least

Or it changes at one rate, as the delay between two clocks does. y is the residual torque, A the columns of the plain
model (inertia, friction, load, gravity). With the error s of the jackknife over blocks d / s is Student's t of as many
blocks less one. Each column and each moment is one question more (G. C. Chow, Econometrica 28 (1960) 591, with an
unknown moment).
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from hil.arrays import FloatArray
from hil.identification.least_squares import Columns, least_squares
from hil.identification.structure import BINS, ResidualSeries, Structure

_STEPS = 200  # of the rows in order of time, at which a moment is sought
_SHORTEST = 20  # steps before and after it: a tenth of the rows, as for the parameters of a part
_BLOCKS = 20  # of the jackknife: a part of a tenth has two
_TOLD = 1e-3  # of the power of a column: below, the other columns do what its change does
_BATCHES = 4  # of a bin, whose spread is its error


class MomentOfChange(NamedTuple):
    """Coefficient, moment [s], change of the coefficient, and its course over time in bins with errors.

    `energy` of the course is the mean square of the residual that the change explains, `p` its chance.
    """

    coefficient: str
    moment_s: float
    change: float
    course: Structure


class SteadyChange(NamedTuple):
    """Coefficient that changes at one rate per second, over how long [s], and its course as in `MomentOfChange`."""

    coefficient: str
    rate: float
    duration_s: float
    course: Structure


class _InTurn(NamedTuple):
    """Residual (n,), time (n,), columns (n, k) and their names of all runs in order of time."""

    left: FloatArray
    time_s: FloatArray
    table: FloatArray
    names: list[str]


def _in_turn(
    parts: Sequence[ResidualSeries], columns: Sequence[Columns], times_s: Sequence[FloatArray]
) -> _InTurn | None:
    """The rows that count; None where they are few, or a column is zero."""
    counted = [run for run, part in enumerate(parts) if part.rows.any()]
    order = sorted(counted, key=lambda run: float(times_s[run][parts[run].rows][0]))
    if not order:
        return None
    left, time_s = (
        np.concatenate([one[run][parts[run].rows] for run in order]) for one in ([p.left for p in parts], times_s)
    )
    names = list(columns[0])
    table = np.column_stack([np.concatenate([columns[run][name][parts[run].rows] for run in order]) for name in names])
    return _InTurn(left, time_s, table, names) if left.size >= _STEPS * 2 and table.any(axis=0).all() else None


def moment_of_change(
    parts: Sequence[ResidualSeries], columns: Sequence[Columns], times_s: Sequence[FloatArray]
) -> MomentOfChange | None:
    """Find the moment with most evidence in residuals, columns and times (n,) of runs; None where rows are few."""
    rows = _in_turn(parts, columns, times_s)
    if rows is None:
        return None
    edges = np.linspace(0, rows.left.size, _STEPS + 1).astype(int)
    at, step = _most_explained(rows.table / np.linalg.norm(rows.table, axis=0), rows.left, edges)
    shape = (np.arange(rows.left.size) >= edges[step]).astype(float)
    found = _changed(rows, at, shape, len(rows.names) * (_STEPS - 2 * _SHORTEST))
    return MomentOfChange(rows.names[at], float(rows.time_s[edges[step]]), *found) if found else None


def steady_change(
    parts: Sequence[ResidualSeries],
    columns: Sequence[Columns],
    times_s: Sequence[FloatArray],
    name: str,
    asked: int = 1,
) -> SteadyChange | None:
    """The rate at which a coefficient changes, with 1(t >= t1) replaced by t; None where rows are few.

    `asked`: number of coefficients of which the caller takes the surest.
    """
    rows = _in_turn(parts, columns, times_s)
    if rows is None:
        return None
    found = _changed(rows, rows.names.index(name), rows.time_s - float(np.mean(rows.time_s)), asked)
    return SteadyChange(name, found[0], float(np.ptp(rows.time_s)), found[1]) if found else None


def _changed(rows: _InTurn, at: int, shape: FloatArray, asked: int) -> tuple[float, Structure] | None:
    """Size of a change of one coefficient with a shape (n,) over time, and its course; None where no error is known."""
    table, moving = rows.table, rows.table[:, at] * shape
    common = dict(zip(rows.names, table.T, strict=True))
    fit = least_squares({**common, "change": moving}, rows.left, blocks=_BLOCKS)
    change = fit["change"]
    if not np.isfinite(change.std_error) or not change.std_error > 0.0:
        return None
    chance = 2.0 * float(student.sf(abs(change.value) / change.std_error, _BLOCKS - 1))
    moved = change.value * moving
    beside = moved - table @ np.linalg.lstsq(table, moved, rcond=None)[0]  # what the other columns do not take over
    own = fit.residual + moved + fit[rows.names[at]].value * table[:, at]
    bins, means, errors = _course(table[:, at], own, rows.time_s)
    return change.value, Structure(bins, means, errors, float(np.mean(beside**2)), min(asked * chance, 1.0))


def _most_explained(table: FloatArray, left: FloatArray, edges: NDArray[np.intp]) -> tuple[int, int]:
    """Column of a table (n, k) and step at which its change explains most of a residual (n,) beside all columns."""
    both = np.column_stack([table, left])
    products = np.array([both[first:end].T @ both[first:end] for first, end in pairwise(edges)])
    after = products[::-1].cumsum(axis=0)[::-1]  # from each step on
    inverse = np.linalg.pinv(after[0][:-1, :-1], hermitian=True)
    rest = after[0][:-1, -1]
    best = (0.0, 0, 0)
    for step in range(_SHORTEST, _STEPS - _SHORTEST):
        own, seen = after[step][:-1, :-1], after[step][:-1, -1]
        for at in range(table.shape[1]):
            power = own[at, at] - own[:, at] @ inverse @ own[:, at]
            if power > _TOLD * own[at, at]:
                gain = float(seen[at] - own[:, at] @ inverse @ rest) ** 2 / power
                best = max(best, (gain, at, step))
    return best[1], best[2]


def _course(column: FloatArray, own: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bin edges (b + 1,) in time, coefficients (b,) of a column in each, and their errors from those of batches."""
    batches = [
        (float(column[rows] @ own[rows]), float(column[rows] @ column[rows]))
        for rows in np.array_split(np.arange(own.size), BINS * _BATCHES)
    ]
    products, power = np.array(batches).T.reshape(2, BINS, _BATCHES)
    means = products.sum(axis=1) / np.maximum(power.sum(axis=1), 1e-300)
    spread = (products - means[:, None] * power) ** 2
    errors = np.sqrt(spread.sum(axis=1) * _BATCHES / (_BATCHES - 1)) / np.maximum(power.sum(axis=1), 1e-300)
    ends = [float(time_s[rows[-1]]) for rows in np.array_split(np.arange(own.size), BINS)]
    return np.array([float(time_s[0]), *ends]), means, errors
