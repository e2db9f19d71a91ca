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


def strength_over_error(fit: Fit, index: int) -> float:
    """Largest difference of a strength of a term from no effect, in its standard errors; 0 where none is told."""
    term, columns = fit.terms[index], fit.hypothesis.columns(index)
    mechanism = BY_ID[term.effect]
    sizes = {place: abs(term.values[place]) for place in mechanism.indices(Role.STRENGTH)}
    sizes[mechanism.strength] = mechanism.size(term.values, axis_facts(fit.bench, fit.data.runs))
    known = set(range(columns.start, columns.stop)) - {columns.start + place for place in sizes}
    errors = standard_errors(fit, known)[columns]
    return max(size / errors[place] if math.isfinite(errors[place]) else 0.0 for place, size in sizes.items())
