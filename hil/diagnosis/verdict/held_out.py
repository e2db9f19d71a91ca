"""Test the terms of a search on held-out recordings."""

from dataclasses import replace

from hil.diagnosis.search.events import with_events_of
from hil.diagnosis.search.forward_selection import beside
from hil.diagnosis.stages import Searched, Tested
from hil.diagnosis.verdict.cross_validation import cross_validate
from hil.diagnosis.verdict.findings import renamed
from hil.diagnosis.verdict.refit import reported_refit


def test_on_held_out(searched: Searched) -> Tested:
    """Test the terms of a search, with the events of the held-out recordings, and refit the nominal parameters.

    A search that ended with its budget leaves no time for events that it has not found in training.
    """
    nominal, held_out, final = searched.nominal, searched.prepared.held_out, renamed(searched.final)
    if not searched.stopped_at or any(term.windows for term in final.terms):
        final = with_events_of(held_out, final)
    set_aside = final.data.set_aside
    if set_aside:
        beside_them = cross_validate(beside(nominal, set_aside), final, held_out.louder(set_aside))
        proof = replace(beside_them, final=beside(beside_them.final, {}))
    else:
        proof = cross_validate(nominal, final, held_out)
    return Tested(searched, proof, reported_refit(nominal))
