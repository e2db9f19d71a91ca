"""Check that the fitted values of a term still are what its name says."""

from hil.bench.bench_file import Bench
from hil.diagnosis.search.initial_values import axis_facts
from hil.identification.terms import Term
from hil.twin.library import BY_ID


def claimable(term: Term, bench: Bench) -> bool:
    """Check that the mechanism's name applies to the values, and that the sensors can show it."""
    return BY_ID[term.effect].is_valid(term.values, term.variant, axis_facts(bench))
