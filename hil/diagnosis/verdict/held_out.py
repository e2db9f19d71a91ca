"""Test the terms of a search on held-out recordings."""

from dataclasses import replace

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.events_everywhere import with_events
from hil.diagnosis.search.forward_selection import claimed
from hil.diagnosis.search.refits import carried, over
from hil.diagnosis.stages import Searched, Tested
from hil.diagnosis.structure_left import like_noise, structure_left
from hil.diagnosis.verdict.cross_validation import CrossValidation, Rivals, cross_validate
from hil.diagnosis.verdict.findings import confidences, form_of, renamed, rivals_of
from hil.diagnosis.verdict.refit import reported_refit
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.noise_apart import noise_apart
from hil.identification.torque_left import fit_plain

_TABLE = "table"  # channel of the twin


def test_on_held_out(searched: Searched) -> Tested:
    """Test the terms of a search, with the events of the held-out recordings, and refit the nominal parameters.

    A search that ended with its budget leaves no time for events that it has not found in training.
    """
    nominal, held_out, final = searched.nominal, searched.prepared.held_out, renamed(searched.final)
    if not searched.stopped_at or any(term.windows for term in final.terms):
        final = with_events(final, held_out)
    final = with_own_noise(final, held_out)
    data, plain = final.data, fit_plain(final.data)
    rivals = {term.key: rivals_of(searched, term) for term in final.terms}
    if data is searched.prepared.train:
        return _tested(searched, _proof(searched, nominal, final, held_out, rivals))
    there = held_out.louder(data.set_aside)
    if data.apart and plain:  # by a twin that holds the motion
        reference = nominal if nominal.within_noise else final
        there = noise_apart(there, reference.hypothesis, plain)
    base = over(data, nominal)
    proof = _proof(searched, base, final, there, rivals)
    return _tested(searched, replace(proof, final=carried(searched.prepared.train, proof.final)))


def with_own_noise(fit: Fit, held_out: Dataset) -> Fit:
    """The fit of terms, with what it leaves of the second encoder as its noise, if that is like noise.

    A sensor that wanders far above its white noise bends masses and friction.
    """
    ratio = min(ratios.get(_TABLE, 0.0) for ratios in fit.noise_ratios)  # one that wanders more mutes no other one
    if not fit.terms or ratio <= CRITERIA.floor or _TABLE not in like_noise(fit, structure_left(fit, held_out)):
        return fit
    known = fit.data.set_aside
    return over(fit.data.louder({**known, _TABLE: known.get(_TABLE, 1.0) * ratio**0.5}), fit)


def _proof(searched: Searched, nominal: Fit, final: Fit, held_out: Dataset, rivals: Rivals) -> CrossValidation:
    """Test terms; where some are dropped, with the events that show beside the others."""
    proof = likely(searched, nominal, cross_validate(nominal, final, held_out, rivals), held_out)
    if searched.stopped_at or not proof.dropped:
        return proof
    more = with_events(proof.final, held_out)
    if more is proof.final:
        return proof
    again = likely(searched, nominal, cross_validate(nominal, more, held_out, proof.rivals), held_out)
    return replace(again, dropped=(*proof.dropped, *again.dropped))


def _tested(searched: Searched, proof: CrossValidation) -> Tested:
    known = {**searched.rivals, **proof.rivals}
    return Tested(replace(searched, rivals=known), proof, reported_refit(searched.nominal))


def likely(searched: Searched, nominal: Fit, proof: CrossValidation, held_out: Dataset) -> CrossValidation:
    """The proof without the terms whose confidence is too low for a name, the least one first.

    Confidence is that on the recordings themselves, whatever channels the proof sets aside. A term that corrects the
    form of another one has no name of its own.
    """
    recorded = searched.prepared
    while proof.ablations:
        compared = replace(searched, rivals={**searched.rivals, **proof.rivals})
        final = proof.final if proof.final.data is recorded.train else carried(recorded.train, proof.final)
        sure = confidences(compared, final, proof.ablations, recorded.held_out)
        own = [index for index in range(len(sure)) if index not in form_of(compared, proof.ablations)]
        least = min(own, key=lambda index: sure[index])
        if sure[least] >= CRITERIA.named:
            break
        hardly = proof.ablations[least]
        rest = claimed(hardly.without.refit(30)) if hardly.without.terms else hardly.without
        fewer = cross_validate(nominal, rest, held_out, proof.rivals)
        proof = replace(fewer, dropped=(*proof.dropped, hardly, *fewer.dropped))
    return proof
