"""Search below the noise: values of a term where its shape tells them, in the torque and between the encoders.

There the energy of a position says nothing of a term, so that neither the score test nor a fit of the motion ranks
terms or finds where one begins. Strength and phase of each start are those of least squares in what the base leaves
(`search.shape`); the clearest starts are fitted.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.harmonics import combined, is_scaled, pairs, spanning
from hil.diagnosis.search.initial_values import claimable
from hil.diagnosis.search.score_test import Candidate
from hil.diagnosis.search.shape import Size, log_chance_below_noise, log_chance_of_shape, prepare, sizes
from hil.diagnosis.search.successive_halving import SECOND, equivalents, finish, variants
from hil.identification.coefficient import log_tail
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.intended_motion import measured_motion
from hil.identification.parallel import in_parallel
from hil.identification.terms import Term, compatible
from hil.identification.torque_left import fit_plain
from hil.twin.library import BY_ID
from hil.twin.parameter import Role

_FITTED = 5  # terms with the clearest shapes: as many as a race by cost fits a second time


def shown(base: Fit, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates whose shape is in what a base leaves, the clearest first, at the values that it tells."""
    prepare(base)  # once, before the jobs ask for it
    found = in_parallel([partial(_clearest, base, one) for one in candidates])
    level = [(least, one) for least, one in found if least < math.log(CRITERIA.significance)]
    return [one for _, one in sorted(level, key=lambda pair: pair[0])]


def fitted(base: Fit, candidates: Sequence[Candidate]) -> list[Fit]:
    """Fit the base with each of the first candidates, and with what else may have the shape of the clearest."""

    def begun(one: Candidate) -> Fit:
        return finish(base.estimator.fit(base.hypothesis.with_term(one.term), evaluations=SECOND))

    found = in_parallel([partial(begun, one) for one in candidates[:_FITTED]])
    chance = {id(fit): log_chance_below_noise(fit, base) or 0.0 for fit in found}
    best = min(found, key=lambda fit: chance[id(fit)])
    if not base.estimator.expired:
        others = [*variants(best), *equivalents(base, best)]
        chance |= {id(fit): log_chance_below_noise(fit, base) or 0.0 for fit in others}
        found += others
    clearest = dict[str, Fit]()
    for fit in sorted(found, key=lambda fit: chance[id(fit)]):
        if compatible(fit.terms):
            clearest.setdefault(fit.terms[-1].effect, fit)
    return list(clearest.values())


def _clearest(base: Fit, candidate: Candidate) -> tuple[float, Candidate]:
    """Least logarithm of the chance of a candidate's starts, and the candidate at the values of that start."""
    starts = {_place(term): term for term in reversed((candidate.term, *candidate.others))}
    best, at = 0.0, candidate.term
    for term in reversed(starts.values()):
        scaled = _scaled(base, term)
        if scaled is None or not (claimable(scaled, base.bench, base.data.runs) and _resolved(base, scaled)):
            continue
        least = log_chance_of_shape(base.hypothesis.with_term(scaled), base, fitted=False)
        if least < best:
            best, at = least, scaled
    return best, replace(candidate, term=at, others=())


def _resolved(base: Fit, term: Term) -> bool:
    """True if the rows resolve the wave of a term, if it has one, in half of the sliding motion or more (Nyquist)."""
    mechanism, axis = BY_ID[term.effect], base.bench.axis
    order, period_m = mechanism.named(Role.ORDER, term.values), mechanism.named(Role.PERIOD, term.values)
    if order is not None:
        per_unit = order * axis.physics().angle_per_unit
    elif period_m is not None:
        per_unit = 2.0 * math.pi * axis.ratio_m_rad / period_m
    else:
        return True
    return abs(per_unit) * _median_step(base.data) < math.pi


@lru_cache(maxsize=8)
def _median_step(data: Dataset) -> float:
    """Median way of the motor from row to row where the axis slides [motor unit]; infinite where it does not."""
    plain = fit_plain(data)
    moved = [(run, measured_motion(run)) for run in data.runs] if plain else []
    steps = [run.period_s * np.abs(one.moved.velocity)[one.sliding(plain.slowest)] for run, one in moved if plain]
    together = np.concatenate([np.zeros(0), *steps])
    return float(np.median(together)) if together.size else math.inf


def _place(term: Term) -> tuple[object, ...]:
    """Variant, windows and values of a start, without strength and phase if least squares tell these."""
    if not is_scaled(term):
        return term.variant, term.values
    apart = {index for pair in pairs(term) for index in pair}
    return term.variant, tuple(value for index, value in enumerate(term.values) if index not in apart), term.windows


def _scaled(base: Fit, term: Term) -> Term | None:
    """The term with the strengths and phases that least squares tell; None if it has none that are allowed."""
    if not is_scaled(term):
        return term
    seen = sizes([base.hypothesis.with_term(one) for one in spanning(term)], base)
    if not seen:
        return None
    told = combined(term, [one.told.value for one in _of_clearest_channel(seen)])
    values, parameters = list(told.values), BY_ID[term.effect].parameters
    for strength, *_ in pairs(term):
        if not values[strength] >= parameters[strength].low:
            return None
        values[strength] = min(values[strength], parameters[strength].high)
    return replace(told, values=tuple(values))


def _of_clearest_channel(seen: Sequence[Sequence[Size]]) -> Sequence[Size]:
    """Sizes by the channel that tells them best; of the ways in which it tells them clearly the one with the largest.

    Noise in a shape makes its size too small.
    """
    clearest = min(seen, key=_least)
    alike = [own for own in seen if own[0].channel == clearest[0].channel]
    clear = [own for own in alike if _least(own) < math.log(CRITERIA.significance)]
    return max(clear, key=_largest, default=clearest)


def _largest(own: Sequence[Size]) -> float:
    return sum(one.told.value**2 for one in own)


def _least(own: Sequence[Size]) -> float:
    """Least logarithm of the chance of one of the sizes."""
    return min(log_tail(abs(one.told.ratio), one.told.free) if one.told.free > 0.0 else 0.0 for one in own)
