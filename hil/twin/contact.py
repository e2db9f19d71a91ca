"""Friction of a contact over one step, as an impulse: rigid, or elastic before it slides.

    v* = velocity after the step without friction,  G = velocity gained per unit of torque over h
    stuck    F = v* / G                 where |F - bias| <= Fc
    sliding  v = (v* - G (bias +- Fc + drag)) / (1 + G c)

so that sticking is exact and needs no smoothed sign function (time stepping after Moreau; Stewart and Trinkle 1996).
Drag may stop a sliding axis, but not turn it round.
"""

from __future__ import annotations

from typing import Any

from numba import njit

# Of all compiled steps: sums may be reordered; a division does not check its divisor.
COMPILE: Any = {"fastmath": {"reassoc", "nsz", "contract", "arcp"}, "error_model": "numpy"}


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
