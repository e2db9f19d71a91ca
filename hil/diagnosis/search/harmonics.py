"""Strength and phase of each harmonic of a term: what spans its effect, and the values that coefficients tell.

A wave of unknown phase is the sum of a sine and a cosine, so that linear least squares tell its strength and phase.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from hil.arrays import FloatArray
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.twin.parameter import Role


def is_scaled(term: Term) -> bool:
    """True if the effect is proportional to the strength: least squares tell it then."""
    mechanism = BY_ID[term.effect]
    return mechanism.search.proportional and mechanism.variants[term.variant].proportional


def pairs(term: Term) -> list[tuple[int, ...]]:
    """Indices of strength and phase of each harmonic; of the strength alone without phases."""
    mechanism = BY_ID[term.effect]
    phases, strength = mechanism.indices(Role.PHASE), mechanism.strength
    return [(strength + 2 * n, phases[0] + 2 * n) for n in range(len(phases))] or [(strength,)]


def spanning(term: Term) -> list[Term]:
    """Terms that span the effect of a term: itself, or sine and cosine of each harmonic at the first strength."""
    every, found = pairs(term), []
    if len(every[0]) == 1 or not is_scaled(term):
        return [term]
    for strength, phase in every:
        for angle in (0.0, 0.5 * math.pi):
            values = list(term.values)
            for other, _ in every:
                values[other] = 0.0
            values[strength], values[phase] = term.values[every[0][0]], angle
            found.append(replace(term, values=tuple(values)))
    return found


def combined(term: Term, coefficients: Sequence[float] | FloatArray) -> Term:
    """The term with the strengths and phases of the sum of `spanning` with coefficients, whatever its bounds."""
    values, unit = list(term.values), term.values[pairs(term)[0][0]]
    for n, (strength, *phase) in enumerate(pairs(term)):
        factor = coefficients[n]
        if phase:
            sine, cosine = coefficients[2 * n : 2 * n + 2]
            factor, values[phase[0]] = math.hypot(sine, cosine), math.atan2(cosine, sine)
        values[strength] = unit * factor
    return replace(term, values=tuple(float(value) for value in values))
