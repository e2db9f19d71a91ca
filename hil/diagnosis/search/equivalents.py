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
from hil.twin.library import BY_ID

_PHASES = np.arange(8) * np.pi / 4.0  # the zero of the table is not the motor's, and the way back turns the sign


def likenesses(terms: Sequence[Term], bench: Bench) -> list[list[Term]]:
    """For each mechanism that the last term may pass for: that one at eight phases. `bench` is the one as fitted."""
    *rest, last = terms
    values = dict(zip(BY_ID[last.effect].names, last.values, strict=True))
    physics = bench.axis.physics()
    lead_m = 2.0 * np.pi * bench.axis.ratio_m_rad / physics.angle_per_unit
    if last.effect == "position_dependent_friction":
        share, order = values["fraction"], lead_m / values["period_m"]
    elif last.effect in ("cogging_torque", "torque_ripple") and physics.coulomb_n_m > 0.0:
        share, order = last.values[0], values["cycles_per_rev"]
        if last.effect == "cogging_torque":
            share /= physics.coulomb_n_m
    else:
        return []
    same = {
        "cogging_torque": (share * physics.coulomb_n_m, order),
        "torque_ripple": (share, order),
        "position_dependent_friction": (share, lead_m / order),
    }
    found = []
    for effect, (strength, repeats) in same.items():
        most, bounds, _ = BY_ID[effect].parameters
        if effect != last.effect and bounds.low <= repeats <= bounds.high:
            found.append(
                [
                    Term(effect, 0, (min(strength, most.high), repeats, phase), free_slot(effect, rest))
                    for phase in _PHASES
                ]
            )
    return found
