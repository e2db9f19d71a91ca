"""The law of a mechanism as a curve, and the points measured of it.

A point is a partial residual (W. A. Larsen and S. J. McCleary, Technometrics 14 (1972) 781): the law at the mean of a
bin, and what the final twin leaves there. So a law that is right runs through its points within their errors, and one
of another form, size or phase does not. `before` is the residual itself, without the term.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.structure import ResidualSeries, autocovariance
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.twin.mechanism import PARAMETERS, WIDTH, Moment

FINE = 600  # points of a curve: more than the pixels of a picture's half
ROWS_PER_BIN = 60  # on average; a shorter recording gets wider bins
FEWEST_ROWS = 8  # of a bin
LEAST_VARIANCE = 0.01  # of a mean over that of independent rows, and of a bin over that of all
LONGEST_ROWS = 400  # of the correlation counted in an error: noise of sensors and observer decays before


@dataclass(frozen=True, eq=False)
class FittedRows:
    """Rows of one run: quantity x (n,), factor of the law in the residual (n,), residuals (n,), rows that count."""

    x: FloatArray
    carrier: FloatArray
    before: FloatArray
    after: FloatArray
    used: NDArray[np.bool_]
    resolution: float = 0.0  # of the residual over the carrier: an error that rows of one bin have in common


class Means(NamedTuple):
    """Mean quantity, residuals over the carrier before and after, and standard error (m,) of each bin."""

    x: FloatArray
    before: FloatArray
    after: FloatArray
    error: FloatArray


def law_at(
    term: Term,
    bench: Bench,
    value: float | FloatArray = 0.0,
    *,
    angle_rad: float | FloatArray = 0.0,
    velocity: float | FloatArray = 0.0,
    table_m: float | FloatArray = 0.0,
    time_s: float | FloatArray = 0.0,
) -> FloatArray:
    """Value (n,) of a term's stage, of which it is a function without memory, from the value before it."""
    contribution = BY_ID[term.effect].variants[term.variant].contribution
    parameters = np.zeros(PARAMETERS)
    parameters[: len(term.values)] = term.values
    memory, viscous_speed = np.zeros(WIDTH), bench.axis.physics().viscous_speed
    states = np.broadcast_arrays(
        *(np.asarray(one, dtype=float) for one in (value, angle_rad, velocity, table_m, time_s))
    )
    found = [
        contribution(
            u, Moment(t, 0.0, 1.0, 0.0, angle, v, x, bench.axis.ratio_m_rad, viscous_speed), parameters, memory
        )
        for u, angle, v, x, t in zip(*(one.ravel().tolist() for one in states), strict=True)
    ]
    return np.asarray(found, dtype=np.float64)


def bin_edges(rows: Sequence[FittedRows], most: int) -> FloatArray:
    """Edges (m + 1,) of bins of equal width for the rows that count."""
    x = np.concatenate([one.x[one.used] for one in rows])
    count = int(np.clip(x.size / ROWS_PER_BIN, 6, most))
    return np.linspace(float(x.min()), float(x.max()), count + 1)


def means(rows: Sequence[FittedRows], edges: FloatArray) -> Means:
    """Means of the bins that hold enough rows; errors count the autocorrelation of what the means leave."""
    count = edges.size - 1
    at = [np.clip(np.searchsorted(edges, one.x, side="right") - 1, 0, count - 1) for one in rows]
    inside = [one.used & (one.x >= edges[0]) & (one.x <= edges[-1]) for one in rows]

    def sums(of: Sequence[FloatArray]) -> FloatArray:
        pairs = zip(at, inside, of, strict=True)
        counts = [np.bincount(b[i], weights=v[i], minlength=count) for b, i, v in pairs]
        return np.asarray(np.sum(counts, axis=0), dtype=np.float64)

    number = sums([np.ones(one.x.size) for one in rows])
    weight = np.maximum(sums([one.carrier**2 for one in rows]), 1e-300)
    before, after, x = (
        sums(values) / weight
        for values in (
            [one.carrier * one.before for one in rows],
            [one.carrier * one.after for one in rows],
            [one.carrier**2 * one.x for one in rows],
        )
    )
    noise = [ResidualSeries(one.after - one.carrier * after[b], i) for one, b, i in zip(rows, at, inside, strict=True)]
    correlation = autocovariance(noise)[:LONGEST_ROWS]
    variance = correlation[0] * weight
    for lag in range(1, correlation.size):
        for one, b, i in zip(rows, at, inside, strict=True):
            both = i[lag:] & i[:-lag] & (b[lag:] == b[:-lag])
            product = one.carrier[lag:][both] * one.carrier[:-lag][both]
            variance += 2.0 * correlation[lag] * np.bincount(b[lag:][both], weights=product, minlength=count)
    least = LEAST_VARIANCE * correlation[0] * weight  # a truncated correlation may sum to less than nothing
    # noise is not the same everywhere: a reversal, an end of the motion
    local = sums([one.left**2 for one in noise]) / np.maximum(number, 1.0) / max(correlation[0], 1e-300)
    error = np.sqrt(np.maximum(variance, least) * np.maximum(local, LEAST_VARIANCE)) / weight
    error = np.hypot(error, max(one.resolution for one in rows))
    kept = number >= FEWEST_ROWS
    return Means(x[kept], before[kept], after[kept], error[kept])
