"""Estimate the disturbance torque of a recording, and from it starting values of the search.

    d = e J / tau^2

with the motor's innovation e (see `hil.identification.hypothesis`), the inertia J of the whole axis and the time
constant tau of the observer: the torque whose effect equals the observer's correction of the motor.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from hil.arrays import FloatArray
from hil.identification.least_squares import least_squares
from hil.identification.measured import Measured
from hil.identification.periods import strongest_periods
from hil.identification.whitening import RANK, filtered, whitening_filter

_SMOOTH_S = 0.006  # mean of the innovations: passes 60 Hz, reduces encoder counts
_FINE_M, _COARSEST_M = 1e-3, 1e-2  # signal periods of scales: optical and magnetic ones below, inductive ones above
_PASS_HZ = 60.0  # above, the mean attenuates a ripple by more than a fifth
_BINS = 400  # of the travel, for zones
_ORDERS = np.arange(1, 161)  # of the motor angle: slots, pole passings, and their common multiples
_FEWEST_ROWS, _MOST_ROWS = 100, 20_000  # for orders
_SLOW = 0.05  # of the rows tell an order: most rows of a fast axis do not show a fine ripple
_SLOWER, _REPEATS = 1.1, 4.0  # turns of the motor beyond its own, and periods over the travel, of what turns slower


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Disturbance torque (n,), velocity (n,) [motor units], and the rows where the axis slides."""

    torque: FloatArray
    velocity: FloatArray
    sliding: NDArray[np.bool_]


def disturbance(run: Measured, innovation: FloatArray, inertia: float, observer_s: float) -> Disturbance:
    """The disturbance torque of a run from the motor's innovation (n,) [motor units], measured minus twin."""
    width = _width(run.period_s)
    velocity = smooth(np.gradient(run.motor, run.period_s), run.period_s)
    torque = smooth(innovation, run.period_s) * inertia / observer_s**2
    slow = 2e-3 * np.max(np.abs(velocity), initial=1e-9)
    sliding = np.convolve((np.abs(velocity) < slow).astype(float), np.ones(3 * width), "same") == 0
    sliding[: 10 * width] = sliding[-3 * width :] = False
    return Disturbance(torque, velocity, sliding)


def smooth(values: FloatArray, period_s: float) -> FloatArray:
    """Moving mean (n,) that passes a disturbance up to 60 Hz."""
    width = _width(period_s)
    return np.convolve(values, np.ones(width) / width, "same")


def _width(period_s: float) -> int:
    return max(round(_SMOOTH_S / period_s), 1)


def _over_travel(
    runs: Sequence[Measured], disturbances: Sequence[Disturbance], ratio: float
) -> tuple[FloatArray, FloatArray]:
    """Position of the table [m] by the motor encoder, and torque, of the sliding rows (n,) of all runs."""
    x = np.concatenate([ratio * run.motor[d.sliding] for run, d in zip(runs, disturbances, strict=True)])
    return x, np.concatenate([d.torque[d.sliding] for d in disturbances])


def orders(
    runs: Sequence[Measured],
    disturbances: Sequence[Disturbance],
    angle_per_unit: float,
    most: int = 3,
    weights: Sequence[FloatArray] | None = None,
) -> list[float]:
    """Orders per motor revolution with the strongest disturbance, best first, and always orders 1 and 2.

    Beside friction and inertia, both sides whitened: a slow error has its share at many orders and would hide a ripple.
    `weights` (n,) of each run multiply the ripple, as the torque does. Less than a turn does not tell the best from its
    neighbours. Orders 1 and 2 are typical of an unbalanced or bent screw.
    """
    rows = sum(run.motor.size for run in runs)
    every = [slice(None, None, max(_width(run.period_s) // 2, -(-rows // _MOST_ROWS))) for run in runs]
    at = [d.sliding[step] for d, step in zip(disturbances, every, strict=True)]
    if sum(int(one.sum()) for one in at) < _FEWEST_ROWS:
        return [1.0, 2.0]

    def on_rows(values: Iterable[FloatArray]) -> FloatArray:
        means = (
            uniform_filter1d(one, step.step) if step.step > 1 else one for one, step in zip(values, every, strict=True)
        )
        return np.concatenate([one[step][row] for one, step, row in zip(means, every, at, strict=True)])

    torque, velocity = on_rows(d.torque for d in disturbances), on_rows(d.velocity for d in disturbances)
    change = on_rows(np.gradient(d.velocity) for d in disturbances)
    angle, weight = (
        on_rows(run.motor for run in runs) * angle_per_unit,
        on_rows(weights or [np.ones(run.motor.size) for run in runs]),
    )
    beside = np.column_stack([np.ones_like(torque), np.sign(velocity), velocity, change])
    taps = whitening_filter(torque, beside, at)
    basis, _ = np.linalg.qr(np.column_stack([filtered(column, at, taps) for column in beside.T]))

    def apart(column: FloatArray) -> FloatArray:
        white = filtered(column, at, taps)
        return white - basis @ (basis.T @ white)

    left = apart(torque)
    energies = [
        _explained(left, [apart(weight * wave(order * angle)) for wave in (np.cos, np.sin)]) for order in _ORDERS
    ]
    best = [float(_ORDERS[index]) for index in np.argsort(energies)[::-1][:most]]
    beside_best = [order for order in (best[0] - 1.0, best[0] + 1.0) if order >= 1.0]
    return list(dict.fromkeys((*best, *beside_best, 1.0, 2.0)))


def _explained(signal: FloatArray, columns: Sequence[FloatArray]) -> float:
    """Energy of a signal (n,) that columns (n,) explain by least squares."""
    matrix = np.column_stack(columns)
    return float(signal @ matrix @ np.linalg.lstsq(matrix, signal, rcond=RANK)[0])


def other_orders(runs: Sequence[Measured], disturbances: Sequence[Disturbance], angle_per_unit: float) -> list[float]:
    """The orders above and below all of `orders` with the largest disturbance, as of a gear in front of the encoder, or
    of a pulley or wheel that turns slower than the motor; none without motion."""
    turns = [angle_per_unit * run.motor[d.sliding] / (2.0 * np.pi) for run, d in zip(runs, disturbances, strict=True)]
    rates = np.concatenate([np.abs(d.velocity[d.sliding]) for d in disturbances]) * angle_per_unit / (2.0 * np.pi)
    if not rates.size or not np.any(rates):
        return []
    angle, torque = np.concatenate(turns), np.concatenate([d.torque[d.sliding] for d in disturbances])
    found, order = list[float](), float(_ORDERS[-1])
    while (slow := 2.0 * order * rates < _PASS_HZ).mean() > _SLOW:  # an octave, where the axis is slow enough for it
        peaks = strongest_periods(angle[slow], torque[slow], 0.125 / order, 0.5 / order, 1, 1.0 / order)
        found += [1.0 / whole for one in peaks for whole in dict.fromkeys((1.0 / one, float(round(1.0 / one))))]
        order *= 2.0
    longest = float(np.ptp(angle)) / _REPEATS
    if longest > _SLOWER:
        found += strongest_periods(angle, torque, _SLOWER / 32.0, _SLOWER, 1, longest)
    return [1.0 / period for period in found]


def friction_periods(
    runs: Sequence[Measured], disturbances: Sequence[Disturbance], ratio: float, most: int = 4
) -> list[float]:
    """Periods along the travel [m], from 1 mm up, with the largest variation of friction, best first."""
    x, torque = _over_travel(runs, disturbances, ratio)
    velocity = np.concatenate([d.velocity[d.sliding] for d in disturbances])
    return strongest_periods(x, torque * np.sign(velocity), 1e-4, 1e-3, most)


def waves(
    runs: Sequence[Measured],
    disturbances: Sequence[Disturbance],
    ratio: float,
    most: int = 3,
    weights: Sequence[FloatArray] | None = None,
) -> list[float]:
    """Waves per metre of travel with the largest disturbance, best first, where no revolution is known.

    `weights` (n,) of each run: of a disturbance that grows with them, as the ripple does with the torque.
    """
    x, torque = _over_travel(runs, disturbances, ratio)
    if weights is not None:
        torque = torque * np.concatenate([one[d.sliding] for one, d in zip(weights, disturbances, strict=True)])
    return [1.0 / period_m for period_m in strongest_periods(x, torque, 1e-4, 5e-4, most)]


def rest_position(runs: Sequence[Measured], disturbances: Sequence[Disturbance], ratio: float) -> float:
    """Position [m] at which a straight line through the disturbance over the position is 0; 0 if there is none."""
    x, torque = _over_travel(runs, disturbances, ratio)
    if x.size < 2 or np.ptp(x) == 0.0:
        return 0.0
    centre = float(np.mean(x))
    slope = float(np.mean((x - centre) * torque)) / float(np.mean((x - centre) ** 2))
    return centre - float(np.mean(torque)) / slope if slope else 0.0


def scale_periods(runs: Sequence[Measured], errors: Sequence[FloatArray], most: int = 2) -> list[float]:
    """Periods [m] in which an error (n,) of the linear encoder repeats, best first: fine ones, then coarse ones."""
    x, error = np.concatenate([run.table_m for run in runs]), np.concatenate(list(errors))
    fine = strongest_periods(x, error, 0.5e-6, 2e-6, most, longest=_FINE_M)
    return [*fine, *strongest_periods(x, error, _FINE_M / 4.0, _FINE_M, most, longest=_COARSEST_M)]


def lines_hz(run: Measured, d: Disturbance, most: int = 4) -> list[float]:
    """Frequencies [Hz], up to 60 Hz, of the strongest lines of the disturbance over time while the axis slides, best
    first; of what constant, Coulomb and viscous friction leave."""
    if np.count_nonzero(d.sliding) < 100:
        return []
    velocity, left = d.velocity[d.sliding], np.zeros(d.torque.size)
    friction = {"coulomb": np.sign(velocity), "viscous": velocity, "offset": np.ones_like(velocity)}
    left[d.sliding] = least_squares(friction, d.torque[d.sliding], blocks=0).residual
    time_s = np.arange(left.size, dtype=np.float64) * run.period_s
    return [1.0 / wave_s for wave_s in strongest_periods(time_s, left, run.period_s, 1.0 / _PASS_HZ, most)]


def force_windows(run: Measured, d: Disturbance, most: int = 3) -> list[tuple[float, float, float]]:
    """Start, end [s] and level [motor units] of the most significant constant disturbances, best first; they are apart.

    At least one.
    """
    block = max(int(0.02 / run.period_s), 1)
    n = run.motor.size // block
    own = np.arange(run.motor.size) >= run.evaluated.start  # those before belong to another part
    mask = (d.sliding & own)[: n * block].reshape(n, block)
    values = np.where(mask, d.torque[: n * block].reshape(n, block), 0.0).sum(axis=1)
    counts, scale, found = mask.sum(axis=1, dtype=np.float64), block * run.period_s, list[tuple[float, float, float]]()
    taken = np.zeros(n, dtype=bool)
    while len(found) < most:
        apart = [one for one in _levels(values, counts) if not taken[one.first : one.last].any()]
        best = max(apart, key=lambda one: one.score, default=None)
        if best is None or (found and not best.score > 0.0):
            break
        found.append((best.first * scale, best.last * scale, best.level))
        values[best.first : best.last] = counts[best.first : best.last] = 0.0
        taken[best.first : best.last] = True
    return found


def zones(
    runs: Sequence[Measured], disturbances: Sequence[Disturbance], ratio: float, weights: Sequence[FloatArray]
) -> list[tuple[float, float, float]]:
    """Zones of the travel with the most significant constant share of `weights` above and below the mean, best first.

    Each is start, end [m] and share. `weights` (n,) of each run: friction against the motion, or the torque. They and
    the disturbance are summed in bins of the position by the motor encoder, both directions together, so that a
    constant force and a lag of the observer cancel.
    """
    x, torque = _over_travel(runs, disturbances, ratio)
    weight = np.concatenate([one[d.sliding] for one, d in zip(weights, disturbances, strict=True)])
    size = float(np.sqrt(np.mean(weight**2))) if x.size else 0.0
    if x.size < 100 or np.ptp(x) == 0.0 or size == 0.0:
        return []
    weight = weight / size
    width = float(np.ptp(x)) / _BINS
    index = np.minimum(((x - x.min()) / width).astype(int), _BINS - 1)
    sums = np.bincount(index, weights=weight * torque, minlength=_BINS).astype(np.float64)
    counts = np.bincount(index, weights=weight**2, minlength=_BINS).astype(np.float64)
    levels = sorted(_levels(sums, counts), key=lambda level: -level.score)
    start = float(x.min())
    return [
        (start + width * one.first, start + width * one.last, one.level / size) for one in levels if one.score > 0.0
    ]


class _Level(NamedTuple):
    """Bins from `first` to before `last` with a constant level above the mean of all, and its significance."""

    first: int
    last: int
    level: float
    score: float


def _levels(sums: FloatArray, counts: FloatArray) -> list[_Level]:
    """The most significant constant levels above and below the mean, of sums and counts of values in bins (n,)."""
    mean = sums.sum() / max(counts.sum(), 1)
    total = np.concatenate([[0.0], np.cumsum(sums - mean * counts)])
    count = np.concatenate([[0.0], np.cumsum(counts)])
    stride = max(sums.size // 600, 1)
    total, count = total[::stride], count[::stride]
    inside = np.subtract.outer(total, total).T
    sizes = np.subtract.outer(count, count).T
    rest = np.maximum(count[-1] - sizes, 1.0)
    score = np.where(sizes > 5, inside**2 * (1.0 / np.maximum(sizes, 1.0) + 1.0 / rest), 0.0)
    levels = []
    for signed in (np.where(inside > 0.0, score, 0.0), np.where(inside < 0.0, score, 0.0)):
        first, last = np.unravel_index(int(np.argmax(np.triu(signed))), signed.shape)
        level = float(inside[first, last] / max(sizes[first, last], 1.0))
        levels.append(
            _Level(int(first) * stride, max(int(last), int(first) + 1) * stride, level, float(signed[first, last]))
        )
    return levels
