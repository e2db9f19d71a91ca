"""Strength of a term over its standard error: is the effect there?

Its other values count as known: growth or drift that goes on beyond the recording tells its rate, but neither its end
nor its time constant, and is there all the same.
"""

import math

from hil.diagnosis.search.facts import axis_facts
from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.twin.library import BY_ID
from hil.twin.parameter import Role


def strength_errors(fit: Fit, index: int) -> list[float]:
    """Standard errors of the values of a term, those of its strengths as if its other values were given."""
    columns = fit.hypothesis.columns(index)
    strengths = BY_ID[fit.terms[index].effect].indices(Role.STRENGTH)
    known = set(range(columns.start, columns.stop)) - {columns.start + place for place in strengths}
    return standard_errors(fit, known)[columns]


def strength_over_error(fit: Fit, index: int) -> float:
    """Largest difference of a strength of a term from no effect, in its standard errors; 0 where none is told."""
    term, mechanism = fit.terms[index], BY_ID[fit.terms[index].effect]
    sizes = {place: abs(term.values[place]) for place in mechanism.indices(Role.STRENGTH)}
    sizes[mechanism.strength] = mechanism.size(term.values, axis_facts(fit.bench, fit.data.runs))
    errors = strength_errors(fit, index)
    return max(size / errors[place] if math.isfinite(errors[place]) else 0.0 for place, size in sizes.items())
