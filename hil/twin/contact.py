"""Friction of a contact over one step, as an impulse: rigid, or elastic before it slides.

    v* = velocity after the step without friction,  G = velocity gained per unit of torque over h
    stuck    F = v* / G                 where |F - bias| <= Fc
    sliding  v = (v* - G (bias +- Fc + drag)) / (1 + G c)

so that sticking is exact and needs no smoothed sign function (time stepping after Moreau; Stewart and Trinkle 1996).
Drag may stop a sliding axis, but not turn it round.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

# Of all compiled steps: sums may be reordered; a division does not check its divisor.
COMPILE: Any = {"fastmath": {"reassoc", "nsz", "contract", "arcp"}, "error_model": "numpy"}

# Maxwell slip (Iwan 1966; Al-Bender et al. 2005): springs in parallel, each of which slips at a force of its own. Their
# shares of the stiffness and of the bound follow Dahl's curve F = Fc (1 - exp(-x / x0)) by chords between these x / x0,
# of which the first one's slope is the stiffness K: K x0 = 0.93 Fc.
_CHORDS = np.array([0.0, 0.15, 0.35, 0.6, 0.95, 1.4, 2.0, 2.8, 4.0])
_SLOPES = np.diff(np.append(1.0 - np.exp(-_CHORDS[:-1]), 1.0)) / np.diff(_CHORDS)
ELEMENTS = _SLOPES.size
STIFFNESS_SHARES = -np.diff(_SLOPES, append=0.0) / _SLOPES[0]
YIELD_SHARES = -np.diff(_SLOPES, append=0.0) * _CHORDS[1:]


@njit(**COMPILE)
def rigid(free, gain, bound, viscous, shift, opposing):  # type: ignore[no-untyped-def]
    """Friction torque of a rigid contact that meets velocity `free`; see the module's equations."""
    stop = free / gain
    if abs(stop - shift) <= bound:
        return stop
    sign = 1.0 if stop > shift else -1.0
    steady = shift + sign * bound + opposing
    if sign * (stop - steady) <= 0.0:
        return stop
    return steady + viscous * (free - gain * steady) / (1.0 + gain * viscous)


@njit(**COMPILE)
def elastic(free, gain, bound, viscous, shift, opposing, stiffness, deflection, step):  # type: ignore[no-untyped-def]
    """Friction torque and new deflection of an elastic contact (Dahl 1968), implicit in velocity.

    dz/dt = v (1 - sign(v) K z / Fc),  F = K z + c v + shift + drag
    """
    pull = stiffness * deflection
    sign = 1.0 if free - gain * (pull + shift) > 0.0 else -1.0
    if sign * (free - gain * (pull + shift + opposing)) <= 0.0:
        return free / gain, deflection
    yielding = 1.0 - sign * pull / bound if bound > 0.0 else 0.0
    yielding = max(yielding, 0.0)
    steady = pull + shift + opposing
    velocity = (free - gain * steady) / (1.0 + gain * (stiffness * step * yielding + viscous))
    after = deflection + step * velocity * yielding
    limit = bound / stiffness
    after = min(max(after, -limit), limit)
    return stiffness * after + shift + opposing + viscous * velocity, after


@njit(**COMPILE)
def slipping(free, gain, bound, viscous, shift, opposing, stiffness, elements, step):  # type: ignore[no-untyped-def]
    """Friction torque of a contact of Maxwell slip elements, implicit in velocity; advances their torques (ELEMENTS,).

    F = sum of f_i + c v + shift + drag,  f_i = f_i + k_i v h within +-y_i: linear in v piece by piece, hence solved by
    Newton's method in at most one step for each element.
    """
    pull = 0.0
    for i in range(ELEMENTS):
        limit = YIELD_SHARES[i] * bound
        elements[i] = min(max(elements[i], -limit), limit)
        pull += elements[i]
    sign = 1.0 if free - gain * (pull + shift) > 0.0 else -1.0
    if sign * (free - gain * (pull + shift + opposing)) <= 0.0:
        return free / gain
    if sign * pull >= (1.0 - 1e-12) * bound:      # all slip already, and go on
        steady = pull + shift + opposing
        return steady + viscous * (free - gain * steady) / (1.0 + gain * viscous)
    steady, held, velocity = pull, stiffness, 0.0
    for _ in range(ELEMENTS + 1):
        before = held
        missed = free - gain * (steady + shift + opposing + viscous * velocity) - velocity
        velocity += missed / (1.0 + gain * (held * step + viscous))
        steady = held = 0.0
        for i in range(ELEMENTS):
            torque = elements[i] + STIFFNESS_SHARES[i] * stiffness * step * velocity
            limit = YIELD_SHARES[i] * bound
            if abs(torque) < limit:
                held += STIFFNESS_SHARES[i] * stiffness
            steady += min(max(torque, -limit), limit)
        if held == before:
            break
    pull = 0.0
    for i in range(ELEMENTS):
        limit = YIELD_SHARES[i] * bound
        torque = elements[i] + STIFFNESS_SHARES[i] * stiffness * step * velocity
        elements[i] = min(max(torque, -limit), limit)
        pull += elements[i]
    return pull + shift + opposing + viscous * velocity
