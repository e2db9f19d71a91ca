"""Waves of a torque over the angle of its motor: what repeats with each turn, by the raw channels alone.

    T = J a + D v + C sign(v) + T0 + sum_k A_k sin(k q + p_k)

Rows of a standstill count, too: a motor that is held from place to place tells its cogging, and no inertia.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.identification.derivatives import matched
from hil.identification.plain_model import motion_data, plain_columns
from hil.identification.structure import ResidualSeries, structure

Rows = NDArray[np.bool_]
_TURN = 2.0 * np.pi
_STEPS = 720  # of a turn
_ORDERS = _STEPS // 4  # highest order: four steps in a wave
_MET = 0.9  # of the steps of a turn, at least
_CHANCE = 0.01  # of any wave, over all orders
_SHARE = 0.1  # of the energy that the plain model and stronger waves leave
_MOST = 4


class TurnWave(NamedTuple):
    """A wave with its amplitude [unit of the torque]; `order` is its number per turn."""

    order: int
    amplitude: float


def turn_waves(parts: Sequence[tuple[FloatArray, FloatArray]], period_s: float) -> list[TurnWave]:
    """The strongest waves over whole turns of parts (position [rad], torque), each (n,); largest first.

    Empty where the motor does not reach nine tenths of a turn's angles.
    """
    data = [motion_data(position, torque, period_s) for position, torque in parts]
    angles, rows = [position for position, _ in parts], [one.rows for one in data]
    columns = [np.column_stack([*plain_columns(one.moved).values()]) for one in data]
    torque, orders, fit = [one.torque for one in data], list[int](), np.zeros(0)
    while len(orders) < _MOST:
        fit = _least_squares(columns, torque, rows)
        series = [
            ResidualSeries(each - column @ fit, at) for each, column, at in zip(torque, columns, rows, strict=True)
        ]
        order = _strongest(series, angles, orders)
        seen = structure(series, [np.mod(order * one, _TURN) for one in angles]) if order else None
        if seen is None or seen.p * _ORDERS > _CHANCE or seen.energy < _SHARE * _energy(series):
            break
        orders.append(order)
        columns = [
            np.column_stack([column, *(matched(wave(order * angle), one.window) for wave in (np.sin, np.cos))])
            for column, angle, one in zip(columns, angles, data, strict=True)
        ]
    fit = _least_squares(columns, torque, rows)
    pairs = fit[fit.size - 2 * len(orders) :].reshape(-1, 2)
    waves = [TurnWave(order, float(np.hypot(*pair))) for order, pair in zip(orders, pairs, strict=True)]
    return sorted(waves, key=lambda one: -one.amplitude)


def _least_squares(columns: Sequence[FloatArray], torque: Sequence[FloatArray], rows: Sequence[Rows]) -> FloatArray:
    """Coefficients (m,) of columns (n, m) for a torque (n,) of each part, in the rows that count."""
    kept = np.concatenate([column[at] for column, at in zip(columns, rows, strict=True)])
    left = np.concatenate([one[at] for one, at in zip(torque, rows, strict=True)])
    return np.asarray(np.linalg.lstsq(kept, left, rcond=None)[0])


def _energy(series: Sequence[ResidualSeries]) -> float:
    return float(np.mean(np.concatenate([one.left[one.rows] for one in series]) ** 2))


def _strongest(series: Sequence[ResidualSeries], angles: Sequence[FloatArray], known: Sequence[int]) -> int:
    """The strongest order of the means over steps of a turn, beside the known ones; 0 without whole turns."""
    turned = np.concatenate([np.mod(angle[one.rows], _TURN) for one, angle in zip(series, angles, strict=True)])
    steps = (turned / _TURN * _STEPS).astype(int) % _STEPS
    rows = np.bincount(steps, minlength=_STEPS)
    met = rows > 0
    if np.mean(met) < _MET:
        return 0
    sums = np.bincount(steps, np.concatenate([one.left[one.rows] for one in series]), _STEPS)
    means = np.interp(np.arange(_STEPS), np.flatnonzero(met), sums[met] / rows[met], period=_STEPS)
    strength = np.abs(np.fft.rfft(means))[: _ORDERS + 1]
    strength[[0, *known]] = 0.0
    return int(np.argmax(strength))
