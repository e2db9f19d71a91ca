"""Test the terms of a search on held-out recordings."""

from dataclasses import replace

from hil.diagnosis.search.events import with_events_of
from hil.diagnosis.search.forward_selection import over
from hil.diagnosis.stages import Searched, Tested
from hil.diagnosis.verdict.cross_validation import CrossValidation, cross_validate
from hil.diagnosis.verdict.findings import renamed, rivals_of
from hil.diagnosis.verdict.refit import reported_refit
from hil.identification.noise_apart import noise_apart
from hil.identification.torque_left import fit_plain


def test_on_held_out(searched: Searched) -> Tested:
    """Test the terms of a search, with the events of the held-out recordings, and refit the nominal parameters.

    A search that ended with its budget leaves no time for events that it has not found in training.
    """
    nominal, held_out, final = searched.nominal, searched.prepared.held_out, renamed(searched.final)
    if not searched.stopped_at or any(term.windows for term in final.terms):
        final = with_events_of(held_out, final)
    data, plain = final.data, fit_plain(final.data)
    rivals = {term.key: rivals_of(searched, term) for term in final.terms}
    if data is searched.prepared.train:
        return _tested(searched, cross_validate(nominal, final, held_out, rivals))
    there = held_out.louder(data.set_aside)
    if data.apart and plain:  # by a twin that holds the motion
        reference = nominal if nominal.within_noise else final
        there = noise_apart(there, reference.hypothesis, plain)
    proof = cross_validate(over(data, nominal), final, there, rivals)
    return _tested(searched, replace(proof, final=over(searched.prepared.train, proof.final, 1)))


def _tested(searched: Searched, proof: CrossValidation) -> Tested:
    known = {**searched.rivals, **proof.rivals}
    return Tested(replace(searched, rivals=known), proof, reported_refit(searched.nominal))
