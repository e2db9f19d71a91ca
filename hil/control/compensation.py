"""Compensation of one tick: the tables of `hil.control.compensation_tables` at its set-points, bounded and faded in.

    correction  c <- c + clip(w sum P(s) - c, +- speed T),  |sum| <= limit;   velocity += (c - c before) / T
    torque      u <- u + clip(w sum F(s) - u, +- slope T),  |sum| <= limit

s are the set-points; the torque acts until the next tick, so its tables are read at the middle of it. w grows from 0
to 1 over the time of the fade-in, and is 0 in a controlled stop. `step` is compiled: the live loop, the twin beside it,
virtual time and the replay of a recording's set-points (`follow`) call this one function and get the same bits.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from hil.arrays import FloatArray
from hil.compiled.rounding import rounded
from hil.control.compensation_tables import Over, Packed


class Remembered(IntEnum):
    """Places of what a compensation remembers from tick to tick."""

    DIRECTION = 0  # of the last motion: 1 away from home, -1 back, 0 before the first
    REVERSED = 1  # 1 since the first reversal
    SINCE_S = 2  # since the last reversal
    SINCE_M = 3
    WEIGHT = 4  # of the fade-in
    CORRECTION = 5  # [m]
    TORQUE = 6
    DATUM = 7  # place of the set-points at which the motor reads 0 [m]
    PULSE = 8  # share of the pulses after a reversal


class Added(NamedTuple):
    """What a tick adds to position and velocity set-point, and to the torque of the velocity loop."""

    position_m: float
    velocity_m_s: float
    torque: float


class AddedOverTime(NamedTuple):
    """The same over a motion, each (n,)."""

    position_m: FloatArray
    velocity_m_s: FloatArray
    torque: FloatArray


_DIRECTION, _REVERSED, _SINCE_S, _SINCE_M = (int(place) for place in list(Remembered)[:4])
_WEIGHT, _CORRECTION, _TORQUE, _DATUM, _PULSE = (int(place) for place in list(Remembered)[4:])
_OVER = list(Over)
_VELOCITY, _ACCELERATION, _ANGLE = (_OVER.index(one) for one in (Over.VELOCITY, Over.ACCELERATION, Over.ANGLE))
_POSITION, _REVERSAL_TIME = _OVER.index(Over.POSITION), _OVER.index(Over.REVERSAL_TIME)
_TURN = 2.0 * np.pi


def start() -> FloatArray:
    """State before the first tick of a run."""
    state = np.zeros(len(Remembered))
    state[_PULSE] = 0.5
    return state


@njit(_nrt=False, error_model="numpy")
def _clipped(value, limit):  # type: ignore[no-untyped-def]
    return min(max(value, -limit), limit)


@njit(_nrt=False, error_model="numpy")
def _line(knots, first, end, over, x, toward):  # type: ignore[no-untyped-def]
    """Value of a table at x; toward: 1 the column forward, -1 backward, between: their mixture."""
    if over == _ANGLE:
        x = x - rounded(np.floor((x - knots[0, first]) / _TURN) * _TURN)
    elif over != _VELOCITY and over != _ACCELERATION:
        x = min(max(x, knots[0, first]), knots[0, end - 1])
    low, high = first, end - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if knots[0, middle] <= x:
            low = middle
        else:
            high = middle
    share = (x - knots[0, low]) / (knots[0, high] - knots[0, low]) if high > low else 0.0
    forward = knots[1, low] + rounded(share * (knots[1, high] - knots[1, low]))
    backward = knots[2, low] + rounded(share * (knots[2, high] - knots[2, low]))
    return backward + rounded(0.5 * (1.0 + toward) * (forward - backward))


@njit(_nrt=False, error_model="numpy")
def _sum(packed, state, of_torque, position, velocity, acceleration, toward):  # type: ignore[no-untyped-def]
    """Sum of the tables that add to the torque (1) or to the position (0)."""
    total = 0.0
    for index in range(packed.layout.shape[0]):
        over, first, end = packed.layout[index, 1], packed.layout[index, 2], packed.layout[index, 3]
        if packed.layout[index, 0] != of_torque or over >= _REVERSAL_TIME:
            continue
        if over == _VELOCITY:
            x = velocity
        elif over == _ACCELERATION:
            x = acceleration
        elif over == _POSITION:
            x = position
        else:
            x = rounded((position - state[_DATUM]) * packed.constants[6])
        total += _line(packed.knots, first, end, over, x, toward)
    return total


@njit(_nrt=False, error_model="numpy")
def _pulses(packed, state, of_torque, since_s, since_m):  # type: ignore[no-untyped-def]
    """Sum of the whole pulses a time and a way after a reversal."""
    total = 0.0
    for index in range(packed.layout.shape[0]):
        over, first, end = packed.layout[index, 1], packed.layout[index, 2], packed.layout[index, 3]
        if packed.layout[index, 0] == of_torque and over >= _REVERSAL_TIME:
            x = since_s if over == _REVERSAL_TIME else since_m
            total += _line(packed.knots, first, end, over, x, state[_DIRECTION])
    return total


@njit(_nrt=False, error_model="numpy")
def _turned(packed, state, velocity):  # type: ignore[no-untyped-def]
    """Keep direction and way since the last reversal, and what share of a pulse it makes."""
    period = packed.constants[7]
    direction = 1.0 if velocity > 0.0 else -1.0 if velocity < 0.0 else state[_DIRECTION]
    if direction != state[_DIRECTION]:
        whole = abs(_pulses(packed, state, 1, 0.0, 0.0))
        if state[_DIRECTION] != 0.0 and whole > 0.0:
            left = abs(_pulses(packed, state, 1, state[_SINCE_S], state[_SINCE_M])) / whole
            state[_PULSE] = max(1.0 - rounded(state[_PULSE] * left), 0.0)
        state[_REVERSED] = 0.0 if state[_DIRECTION] == 0.0 else 1.0
        state[_DIRECTION], state[_SINCE_S], state[_SINCE_M] = direction, 0.0, 0.0
    else:
        state[_SINCE_S] += period
        state[_SINCE_M] += rounded(abs(velocity) * period)


@njit(_nrt=False, error_model="numpy")
def step(packed, state, position, velocity, acceleration, wanted):  # type: ignore[no-untyped-def]
    """Compute what this tick adds; `state` (len(Remembered),) is changed. wanted: not stopping.

    Where the direction of motion counts, torque goes over within `direction_m_s` about rest, and a position is held at
    rest for the direction of the last motion: a gap stays taken up. A pulse of the torque goes over alike, and is less
    after a stroke in which the one before has not ended, so that the friction of both strokes joins (Masing's rule).
    """
    constants = packed.constants
    period = constants[7]
    _turned(packed, state, velocity)
    state[_WEIGHT] = min(state[_WEIGHT] + period / max(constants[4], period), 1.0) if wanted else 0.0
    weight, before = state[_WEIGHT], state[_CORRECTION]
    since_s, since_m, reversed_ = state[_SINCE_S], state[_SINCE_M], state[_REVERSED]
    total = _sum(packed, state, 0, position, velocity, acceleration, state[_DIRECTION])
    total += rounded(reversed_ * _pulses(packed, state, 0, since_s, since_m))
    target = weight * _clipped(total, constants[2])
    change = _clipped(target - before, rounded(constants[3] * period))
    state[_CORRECTION] = before + change
    half = 0.5 * period
    middle = position + state[_CORRECTION] + rounded(half * velocity)
    speed = velocity + rounded(half * acceleration)
    toward = _clipped(speed / constants[5], 1.0)
    share = rounded(reversed_ * rounded(state[_PULSE] * abs(toward)))
    total = _sum(packed, state, 1, middle, speed, acceleration, toward)
    total += rounded(share * _pulses(packed, state, 1, since_s, since_m))
    target = weight * _clipped(total, constants[0])
    state[_TORQUE] += _clipped(target - state[_TORQUE], rounded(constants[1] * period))
    return Added(state[_CORRECTION], change / period, state[_TORQUE])


@njit(cache=True, nogil=True, error_model="numpy")
def _follow(packed, state, position, velocity, acceleration):  # type: ignore[no-untyped-def]
    n = position.size
    correction, rate, torque = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        added = step(packed, state, position[k], velocity[k], acceleration[k], True)
        correction[k], rate[k], torque[k] = added.position_m, added.velocity_m_s, added.torque
    return correction, rate, torque


def follow(
    packed: Packed, position_m: FloatArray, velocity_m_s: FloatArray, acceleration_m_s2: FloatArray
) -> AddedOverTime:
    """Compute what is added over the set-points (n,) of a whole run, from its start."""
    set_points = (np.ascontiguousarray(one) for one in (position_m, velocity_m_s, acceleration_m_s2))
    return AddedOverTime(*_follow(packed, start(), *set_points))
