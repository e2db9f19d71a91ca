"""Test a term whose law goes on with time inside the time of training, where an end of the recordings refutes it."""

from dataclasses import replace

from hil.diagnosis.search.refits import carried, over
from hil.diagnosis.stages import Searched, Tested
from hil.diagnosis.verdict.held_out import test_on_held_out
from hil.diagnosis.verdict.middle_held_out import with_middle_held_out
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.noise_apart import noise_apart
from hil.identification.torque_left import fit_plain
from hil.twin.library import BY_ID


def test_inside_time(searched: Searched) -> Tested:
    """Test the terms on held-out recordings; where an end refutes one that goes on with time, on the middle.

    The second test counts if it names that term.
    """
    tested = test_on_held_out(searched)
    refuted = {one.term.effect for one in tested.proof.dropped if one.refuted and BY_ID[one.term.effect].text.rate}
    inside = _inside(searched) if refuted else None
    again = test_on_held_out(inside) if inside else tested
    return again if refuted & {one.effect for one in again.proof.final.terms} else tested


def _inside(searched: Searched) -> Searched | None:
    """The fits of a search with the middle of each recording held out; None where that cannot be."""
    prepared, final = with_middle_held_out(searched.prepared), searched.final
    if prepared is None:
        return None
    data, own = prepared.train, final.data.over(prepared.train.runs)
    if final.data is searched.prepared.train:
        own = data
    elif final.data.apart:
        own = _apart(own, searched)
    given, nominal = carried(data, searched.given), over(data, searched.nominal)
    return replace(searched, prepared=prepared, given=given, nominal=nominal, final=over(own, final))


def _apart(data: Dataset, searched: Searched) -> Dataset:
    plain = fit_plain(data)
    reference: Fit = searched.nominal if searched.nominal.within_noise else searched.final
    return noise_apart(data, reference.hypothesis, plain) if plain else data
