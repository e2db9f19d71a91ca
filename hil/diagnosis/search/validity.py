"""Whether the fitted values of a term still are what its name says."""

from __future__ import annotations

import numpy as np

from hil.bench.bench_file import Bench
from hil.identification.terms import FRICTION, Term, ambiguous
from hil.twin.library import BY_ID

_NEAR = 0.9  # of what is possible: not at its end, nor on the way there
_COUNTING = 1.25 / np.pi  # a quarter more than counting itself makes,
_LONG_PERIOD_M = 1e-3  # which has no period as long as this


def claimable(term: Term, bench: Bench) -> bool:
    """Whether the values still are what the mechanism's name says, and whether the sensors can tell.

    Counting errs as a sawtooth, whose fundamental is 1/pi of a count: an error of the linear encoder up to there is
    how counting looks at one feed, and no more. Static friction below Coulomb friction is no Stribeck effect,
    whatever it fits, and what differs by direction by more than Coulomb friction is none: it would drive the axis.
    A spring whose rest lies about as far away as can be is a constant load, a structure that sways about as fast as can
    be is a mass.
    """
    if ambiguous(term) and term.effect == FRICTION:
        return abs(term.values[0]) <= bench.axis.physics().coulomb_n_m
    if term.effect == "spring_load":
        rest = BY_ID[term.effect].parameters[1]
        return _NEAR * rest.low < term.values[1] < _NEAR * rest.high
    if term.effect == "structural_mode":
        return term.values[0] < _NEAR * BY_ID[term.effect].parameters[0].high
    if term.effect == "stribeck_friction":
        return term.values[0] > bench.axis.physics().coulomb_n_m
    if term.effect == "scale_interpolation_error" and bench.encoders.table is not None:
        amplitude_m, period_m, _ = term.values
        return period_m > _LONG_PERIOD_M or amplitude_m > _COUNTING * bench.encoders.table.resolution_m
    return True
