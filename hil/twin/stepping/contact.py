"""Friction of a contact over one step, as an impulse: rigid, or elastic before it slides.

    v* = velocity after the step without friction,  G = velocity gained per unit of torque over h
    stuck    F = v* / G                 where |F - bias| <= Fc
    sliding  v = (v* - G (bias +- Fc + drag)) / (1 + G c)

so that sticking is exact and needs no smoothed sign function (time stepping after Moreau; Stewart and Trinkle 1996).
Drag may stop a sliding axis, but not turn it round.
"""

from typing import Any, NamedTuple

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
_NEWTON, _SOLVED = 20, 1e-9  # limit of steps, each some Fc / K nearer; allowed error of the velocity


class Resistance(NamedTuple):
    """Resistance of a contact to sliding, in motor units."""

    bound: float  # Coulomb friction
    viscous: float
    shift: float  # of the band of Coulomb friction
    opposing: float  # drag beyond Coulomb and viscous friction


@njit(**COMPILE)
def rigid(free, gain, resistance):  # type: ignore[no-untyped-def]
    """Friction torque of a rigid contact that meets velocity `free`; see the module's equations."""
    bound, viscous, shift, opposing = resistance
    stop = free / gain
    if abs(stop - shift) <= bound:
        return stop
    sign = 1.0 if stop > shift else -1.0
    steady = shift + sign * bound + opposing
    if sign * (stop - steady) <= 0.0:
        return stop
    return steady + viscous * (free - gain * steady) / (1.0 + gain * viscous)


@njit(**COMPILE)
def _late(gain, stiffness, step):  # type: ignore[no-untyped-def]
    """Weight of the end of a step against its begin: one half, of second order, where the step resolves the swinging of
    the motor in the contact; towards one, which damps it, where it does not."""
    swung = (gain * stiffness * step) ** 2
    return 0.5 + 0.5 * swung / (1.0 + swung)


@njit(**COMPILE)
def elastic(free, gain, resistance, stiffness, deflection, step, before):  # type: ignore[no-untyped-def]
    """Friction torque over a step and deflection after it of an elastic contact (Dahl 1968), at velocity `before` it.

    dF/dx = K (1 - sign(v) F / Fc), solved exactly along the travel x of the step, which goes by the velocity that is
    sought: Newton's method.
    """
    bound, viscous, shift, opposing = resistance
    pull = stiffness * deflection
    sign = 1.0 if free - gain * (pull + shift) > 0.0 else -1.0
    if sign * (free - gain * (pull + shift + opposing)) <= 0.0:
        return free / gain, deflection
    if bound <= 0.0:
        steady = shift + opposing
        return steady + viscous * (free - gain * steady) / (1.0 + gain * viscous), 0.0
    late = _late(gain, stiffness, step)
    pull = min(max(pull, -bound), bound)
    turned = -(1.0 - late) / late * before  # the velocity at which the travel is none
    missed = free - gain * (pull + shift + opposing + viscous * turned) - turned
    target = bound if missed > 0.0 else -bound
    velocity, after = turned, pull
    for _ in range(_NEWTON):
        velocity += missed / (1.0 + gain * (viscous + late * late * step * stiffness * (1.0 - after / target)))
        travel = step * ((1.0 - late) * before + late * velocity)
        after = target + (pull - target) * np.exp(-stiffness * abs(travel) / bound)
        force = (1.0 - late) * pull + late * after + shift + opposing
        missed = free - gain * (force + viscous * velocity) - velocity
        if abs(missed) <= _SOLVED * (abs(free) + gain * bound):
            break
    return force + viscous * velocity, after / stiffness


@njit(**COMPILE)
def slipping(free, gain, resistance, stiffness, elements, step, before):  # type: ignore[no-untyped-def]
    """Friction torque over a step of a contact of Maxwell slip elements, at velocity `before` it; advances their
    torques (ELEMENTS,).

    f_i = f_i + k_i x within +-y_i, x the travel of the step: linear in the velocity that is sought piece by piece,
    hence solved by Newton's method in at most one step for each element.
    """
    bound, viscous, shift, opposing = resistance
    pull = 0.0
    for i in range(ELEMENTS):
        limit = YIELD_SHARES[i] * bound
        elements[i] = min(max(elements[i], -limit), limit)
        pull += elements[i]
    sign = 1.0 if free - gain * (pull + shift) > 0.0 else -1.0
    if sign * (free - gain * (pull + shift + opposing)) <= 0.0:
        return free / gain
    if sign * pull >= (1.0 - 1e-12) * bound and sign * before >= 0.0:  # all slip already, and go on
        steady = pull + shift + opposing
        return steady + viscous * (free - gain * steady) / (1.0 + gain * viscous)
    late = _late(gain, stiffness, step)
    velocity = -(1.0 - late) / late * before
    after, held = pull, stiffness
    for _ in range(ELEMENTS + 1):
        held_before = held
        force = (1.0 - late) * pull + late * after + shift + opposing
        missed = free - gain * (force + viscous * velocity) - velocity
        velocity += missed / (1.0 + gain * (viscous + late * late * step * held))
        travel = step * ((1.0 - late) * before + late * velocity)
        after = held = 0.0
        for i in range(ELEMENTS):
            torque = elements[i] + STIFFNESS_SHARES[i] * stiffness * travel
            limit = YIELD_SHARES[i] * bound
            if abs(torque) < limit:
                held += STIFFNESS_SHARES[i] * stiffness
            after += min(max(torque, -limit), limit)
        if held == held_before:
            break
    for i in range(ELEMENTS):
        limit = YIELD_SHARES[i] * bound
        elements[i] = min(max(elements[i] + STIFFNESS_SHARES[i] * stiffness * travel, -limit), limit)
    return (1.0 - late) * pull + late * after + shift + opposing + viscous * velocity
