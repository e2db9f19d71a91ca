"""Maps for structure that has no name: what the twin lacks over position, within a period of it, or over speed.

They are tested on held-out motion.

The knots are the means of the structure (`hil.diagnosis.structure_left`), each shrunk by the share of its square that
its standard error explains (W. James, C. Stein, Estimation with Quadratic Loss, 1961), so that noise is no map.
"""

from dataclasses import dataclass, replace

import numpy as np

from hil.diagnosis.questions import POSITION, SPEED
from hil.diagnosis.structure_left import DIFFERENCE, TORQUE, Dependence
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.structure import Structure
from hil.identification.terms import Term
from hil.twin.maps import (
    KNOTS,
    READING_OVER_POSITION,
    READING_WITHIN_PERIOD,
    TORQUE_OVER_POSITION,
    TORQUE_OVER_SPEED,
    TORQUE_WITHIN_PERIOD,
)
from hil.twin.mechanism import Mechanism

_MAPS = {
    (TORQUE, POSITION): TORQUE_OVER_POSITION,
    (TORQUE, SPEED): TORQUE_OVER_SPEED,
    (DIFFERENCE, POSITION): READING_OVER_POSITION,
}
_REPEATS = {TORQUE: TORQUE_WITHIN_PERIOD, DIFFERENCE: READING_WITHIN_PERIOD}


@dataclass(frozen=True, eq=False)
class UnnamedTerm:
    """A map, the dependence that it models, and the rms of what is left on held-out recordings without it and with it.

    The rms is in the unit of the dependence: torque, or position.
    """

    term: Term
    dependence: Dependence
    before: float
    after: float


def unnamed_terms(final: Fit, structure: tuple[Dependence, ...], held_out: Dataset) -> tuple[UnnamedTerm, ...]:
    """For each channel the map that removes most of what is left on held-out recordings; none where no map does."""
    mapped = [one for one in structure if _map_of(one)] if held_out.runs else []
    tried = [one for one in (_tested(final, one, held_out) for one in mapped) if np.isfinite(one.before)]
    best = dict[str, UnnamedTerm]()
    for one in tried:
        known = best.get(one.dependence.channel)
        if one.after < (known.after if known else one.before):
            best[one.dependence.channel] = one
    return tuple(best.values())


def with_maps(fit: Fit, found: tuple[UnnamedTerm, ...]) -> Fit:
    """The fit with maps as further terms, not fitted again."""
    hypothesis = fit.hypothesis
    for one in found:
        hypothesis = hypothesis.with_term(one.term)
    return fit.estimator.evaluate(hypothesis) if found else fit


def _map_of(one: Dependence) -> Mechanism | None:
    return _REPEATS[one.channel] if one.question.period else _MAPS.get((one.channel, one.question.name))


def _tested(final: Fit, one: Dependence, held_out: Dataset) -> UnnamedTerm:
    mapped = _map_of(one)
    assert mapped is not None
    per_unit = final.bench.axis.ratio_m_rad if one.question.name == SPEED else 1.0  # of the motor
    first, last, *knots = _knots(one.found, one.question.period)
    term = Term(mapped.id, 0, (first / per_unit, last / per_unit, *knots))
    there = replace(final, hypothesis=final.hypothesis.with_term(term))
    return UnnamedTerm(term, one, one.rms_left(final, held_out), one.rms_left(there, held_out))


def _knots(found: Structure, period: float) -> list[float]:
    """First and last value of the quantity, and the map at equal steps between; of one that repeats, of a period."""
    middle = 0.5 * (found.edges[:-1] + found.edges[1:])
    shrunk = found.means * np.maximum(1.0 - (found.errors / np.where(found.means, found.means, np.inf)) ** 2, 0.0)
    if period:
        x = np.linspace(0.0, period, KNOTS, endpoint=False)
        return [0.0, period, *(float(value) for value in np.interp(x, middle, shrunk, period=period))]
    x = np.linspace(middle[0], middle[-1], KNOTS)
    return [float(middle[0]), float(middle[-1]), *(float(value) for value in np.interp(x, middle, shrunk))]
