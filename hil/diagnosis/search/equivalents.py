"""What repeats with the screw may pass for on a motion that does not tell: the others, at values that do the same.

While an axis moves one way at one feed, cogging, a torque constant that varies over a turn, and friction that varies
along the screw are one thing. A search that found one of them has yet to give the others the same chance. Strengths are
those at which they are one at a creep, where all torque is Coulomb friction; a fit from there finds the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil.bench.bench_file import Bench
from hil.identification.terms import Term, free_slot
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Dimension, Mechanism, Role

_PHASES = np.arange(8) * np.pi / 4.0  # the zero of the table is not the motor's, and the way back turns the sign


def likenesses(terms: Sequence[Term], bench: Bench) -> list[list[Term]]:
    """For each mechanism that the last term may pass for: that one at eight phases. `bench` is the one as fitted."""
    *rest, last = terms
    physics = bench.axis.physics()
    lead_m = 2.0 * np.pi * bench.axis.ratio_m_rad / physics.angle_per_unit
    if not BY_ID[last.effect].screw_locked or physics.coulomb_n_m <= 0.0:
        return []
    size, place = _size_and_place(BY_ID[last.effect])
    share = last.values[size] / _unit(BY_ID[last.effect], physics.coulomb_n_m)
    order = _other(BY_ID[last.effect], last.values[place], lead_m)
    found = []
    for mechanism in sorted(LIBRARY, key=lambda one: one.parameters[0].dimension is not Dimension.TORQUE):
        if not mechanism.screw_locked or mechanism.id == last.effect:
            continue
        size, place = _size_and_place(mechanism)
        repeats, bounds = _other(mechanism, order, lead_m), mechanism.parameters[place]
        if not bounds.low <= repeats <= bounds.high:
            continue
        values = dict.fromkeys(range(len(mechanism.parameters)), 0.0)
        values[size] = min(share * _unit(mechanism, physics.coulomb_n_m), mechanism.parameters[size].high)
        values[place] = repeats
        (turned,) = mechanism.indices(Role.PHASE)
        slot = free_slot(mechanism.id, rest)
        found.append([Term(mechanism.id, 0, tuple((values | {turned: phase}).values()), slot) for phase in _PHASES])
    return found


def _size_and_place(mechanism: Mechanism) -> tuple[int, int]:
    """Indices of the strength, and of the order or period."""
    return mechanism.strength, (mechanism.indices(Role.ORDER) or mechanism.indices(Role.PERIOD))[0]


def _unit(mechanism: Mechanism, coulomb: float) -> float:
    """Strength that is as much as Coulomb friction."""
    return coulomb if mechanism.parameters[mechanism.strength].dimension is Dimension.TORQUE else 1.0


def _other(mechanism: Mechanism, value: float, lead_m: float) -> float:
    """Order of a mechanism's order or period, and the other way round."""
    return value if mechanism.indices(Role.ORDER) else lead_m / value
