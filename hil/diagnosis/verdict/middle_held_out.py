"""Hold out the middle of recordings instead of an end, for a term whose law goes on with time.

Motion that is held out has the speeds and places of training (`preparation.split`); an end has other times. There such
a term is extrapolated, by a time constant that a part of a warm-up hardly tells.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from hil.diagnosis.search.refits import carried, over
from hil.diagnosis.stages import Prepared, Searched, Tested
from hil.diagnosis.verdict.held_out import test_on_held_out
from hil.diagnosis.wording import HELD_OUT_NOTE, MIDDLE_PART, part_of, title, whole_name
from hil.identification.dataset import Dataset, in_turn
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.noise_apart import noise_apart
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain
from hil.twin.library import BY_ID


class _Parts(NamedTuple):
    """Recordings for training without their middle, and the middle of each."""

    train: list[Measured]
    middle: list[Measured]


def test_inside_time(searched: Searched) -> Tested:
    """Test the terms on held-out recordings; where an end refutes one that goes on with time, on the middle.

    The second test counts if it names that term.
    """
    tested = test_on_held_out(searched)
    refuted = [one.term for one in tested.proof.dropped if one.refuted and _goes_on(one.term)]
    for term in refuted[:1]:
        inside = with_middle_held_out(searched, term)
        again = test_on_held_out(inside) if inside else tested
        if term.effect in {one.effect for one in again.proof.final.terms}:
            return again
    return tested


def with_middle_held_out(searched: Searched, term: Term) -> Searched | None:
    """The fits of a search with the middle of each recording held out; None unless `split` held out ends alone.

    `term` is the reason, for the note.
    """
    prepared, final = searched.prepared, searched.final
    ends = prepared.held_out.runs
    by_split = any(note.startswith(HELD_OUT_NOTE) for note in prepared.notes)
    inside = any(part_of(run.name) == MIDDLE_PART for run in ends)
    parts = _parts(prepared.train.runs, ends) if by_split and not inside else None
    if parts is None:
        return None
    data, own = prepared.train.over(parts.train), final.data.over(parts.train)
    if final.data is prepared.train:
        own = data
    elif final.data.apart:
        own = _apart(own, searched)
    note = (
        f"{HELD_OUT_NOTE} the middle of each recording is used for validation, since {title(term.effect)} goes on "
        "with time; the end, outside the time of the rest, is predicted worse with it."
    )
    notes = (*(one for one in prepared.notes if not one.startswith(HELD_OUT_NOTE)), note)
    parted: Prepared = replace(prepared, train=data, held_out=data.over(parts.middle), notes=notes)
    given, nominal = carried(data, searched.given), over(data, searched.nominal)
    return replace(searched, prepared=parted, given=given, nominal=nominal, final=over(own, final))


def _goes_on(term: Term) -> bool:
    """True of a term that a report may tell as a rate: its law goes on beyond the recording."""
    return bool(BY_ID[term.effect].text.rate)


def _parts(train: Sequence[Measured], held_out: Sequence[Measured]) -> _Parts | None:
    """Cut the training part of each recording; its half beside the end that was held out is the middle."""
    ends = {whole_name(run.name): run for run in held_out}
    if len(ends) < len(held_out):  # recordings of one name
        return None
    parts = _Parts([], [])
    for run in train:
        end = ends.pop(whole_name(run.name), None)
        if end is None:
            parts.train.append(run)
            continue
        ordered = in_turn([run, end])
        if not ordered:
            return None
        row = (run.evaluated.start + run.motor.size) // 2
        first, last = replace(run.until(row), lead_in=run.evaluated.start), replace(run, lead_in=row)
        outer, inner = ([first, end], last) if ordered[0] is run else ([end, last], first)
        parts.train.extend(outer)
        parts.middle.append(replace(inner, name=f"{whole_name(run.name)} ({MIDDLE_PART})"))
    return None if ends or not parts.middle else parts


def _apart(data: Dataset, searched: Searched) -> Dataset:
    plain = fit_plain(data)
    reference: Fit = searched.nominal if searched.nominal.within_noise else searched.final
    return noise_apart(data, reference.hypothesis, plain) if plain else data
