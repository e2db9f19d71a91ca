"""Waves of a torque over the angle of its motor: what repeats with each turn, by the raw channels alone.

    T = J a + D v + C sign(v) + T0 + G sin(r q + q0) + sum_k A_k sin(k q + p_k)        G: of a load that turns

Rows of a standstill count: a motor that is held at one place after another tells its cogging, though no inertia.
"""

from collections.abc import Sequence
from math import tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.identification.derivatives import later_motion, matched
from hil.identification.periods import strongest_periods
from hil.identification.plain_model import motion_data, plain_columns
from hil.identification.structure import ResidualSeries, structure

Rows = NDArray[np.bool_]
_ORDERS = 180  # the highest: a wave of two degrees
_PASSED = 0.9  # of a turn: less tells no order of one
_CHANCE = 0.01  # of the look: by chance alone, one recording in a hundred shows a wave
_SHARE = 0.1  # of the energy that the plain model and stronger waves leave: the least that a wave explains
_MOST_WAVES, _MOST_ROWS, _FEWEST_ROWS = 4, 100_000, 100


class TurnWave(NamedTuple):
    """A wave with its amplitude [unit of the torque]; `order` is its number per turn."""

    order: int
    amplitude: float


def turn_waves(
    parts: Sequence[tuple[FloatArray, FloatArray]],
    period_s: float,
    early_s: float = 0.0,
    load_ratio: float | None = None,
) -> list[TurnWave]:
    """The strongest waves of parts (position [rad], torque), each (n,), that both halves have; at most four.

    Largest first. The torque is recorded `early_s` before its motion. `load_ratio` [load rad per motor rad] of
    a load that turns: its gravity is no wave. Empty where the motor passes less than nine tenths of a turn, or for few
    rows; of many rows the first count.
    """
    angles, torque, columns, rows, windows = [], [], [], [], []
    for position, given in _first(parts):
        data = motion_data(position, given, period_s)
        early, row = early_s / period_s, np.arange(position.size)
        moved = later_motion(data.moved, early)
        angles.append(np.interp(row + early, row, position))
        torque.append(data.torque)
        columns.append(np.column_stack([*plain_columns(moved, load_ratio).values()]))
        rows.append(data.rows)
        windows.append(data.window)
    found, fit = list[int](), np.zeros(0)
    left = _left(columns, torque, rows)[1] if angles else []
    while left and len(found) < _MOST_WAVES:
        order = _strongest(left, angles)
        seen = structure(left, [np.mod(order * one, tau) for one in angles]) if order and order not in found else None
        if seen is None or seen.p * _ORDERS > _CHANCE:
            break
        more = [
            np.column_stack([column, *(matched(wave(order * angle), window) for wave in (np.sin, np.cos))])
            for column, angle, window in zip(columns, angles, windows, strict=True)
        ]
        again, rest = _left(more, torque, rows)
        if _energy(rest) > (1.0 - _SHARE) * _energy(left) or not _repeats(again, more, torque, rows):
            break
        found, columns, fit, left = [*found, order], more, again, rest
    pairs = fit[fit.size - 2 * len(found) :].reshape(-1, 2)
    told = [TurnWave(order, float(np.hypot(*pair))) for order, pair in zip(found, pairs, strict=True)]
    return sorted(told, key=lambda one: -one.amplitude)


def _first(parts: Sequence[tuple[FloatArray, FloatArray]]) -> list[tuple[FloatArray, FloatArray]]:
    """The first rows of parts, as many as count."""
    counted, free = list[tuple[FloatArray, FloatArray]](), _MOST_ROWS
    for position, torque in parts:
        if min(position.size, free) >= _FEWEST_ROWS:
            counted.append((position[:free], torque[:free]))
            free -= counted[-1][0].size
    return counted


def _left(
    columns: Sequence[FloatArray], torque: Sequence[FloatArray], rows: Sequence[Rows]
) -> tuple[FloatArray, list[ResidualSeries]]:
    """Coefficients (m,) of columns (n, m) for torques (n,), in the rows that count, and what they leave."""
    kept = np.concatenate([column[at] for column, at in zip(columns, rows, strict=True)])
    fit = np.linalg.lstsq(kept, np.concatenate([one[at] for one, at in zip(torque, rows, strict=True)]), rcond=None)[0]
    return fit, [ResidualSeries(one - column @ fit, at) for one, column, at in zip(torque, columns, rows, strict=True)]


def _energy(series: Sequence[ResidualSeries]) -> float:
    return float(np.mean(np.concatenate([one.left[one.rows] for one in series]) ** 2))


def _repeats(
    fit: FloatArray, columns: Sequence[FloatArray], torque: Sequence[FloatArray], rows: Sequence[Rows]
) -> bool:
    """True if both halves of the rows have the last wave: nearer to that of all rows than to none."""
    halves = [[np.cumsum(at) <= at.sum() // 2 for at in rows], [np.cumsum(at) > at.sum() // 2 for at in rows]]
    return all(
        np.linalg.norm(
            _left(columns, torque, [at & one for at, one in zip(rows, half, strict=True)])[0][-2:] - fit[-2:]
        )
        < 0.5 * np.linalg.norm(fit[-2:])
        for half in halves
    )


def _strongest(series: Sequence[ResidualSeries], angles: Sequence[FloatArray]) -> int:
    """The strongest order of what is left over the angle of a turn; 0 without a whole turn."""
    if max(float(np.ptp(one)) for one in angles) < _PASSED * tau:
        return 0
    turned = np.concatenate([np.mod(angle[one.rows], tau) for one, angle in zip(series, angles, strict=True)])
    left = np.concatenate([one.left[one.rows] for one in series])
    found = strongest_periods(turned, left, tau / (4 * _ORDERS), tau / _ORDERS, most=1)
    return round(tau / found[0]) if found else 0
