"""Hold out the middle of recordings instead of an end, for a term whose law goes on with time.

Motion that is held out has the speeds and places of training (`preparation.split`); an end has other times. There such
a term is extrapolated, by a time constant that a part of a warm-up hardly tells.
"""

from collections.abc import Sequence
from dataclasses import replace

from hil.diagnosis.search.refits import carried, over
from hil.diagnosis.stages import Prepared, Searched, Tested
from hil.diagnosis.verdict.held_out import test_on_held_out
from hil.diagnosis.wording import HELD_OUT_NOTE, MIDDLE_PART, title, whole_name
from hil.identification.dataset import Dataset, in_turn
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.noise_apart import noise_apart
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain
from hil.twin.library import BY_ID


def test_inside_time(searched: Searched) -> Tested:
    """Test the terms on held-out recordings; where an end refutes one that goes on with time, on the middle."""
    tested = test_on_held_out(searched)
    refuted = [one.term for one in tested.proof.dropped if _goes_on(one.term)]
    inside = with_middle_held_out(searched, refuted[0]) if refuted else None
    again = test_on_held_out(inside) if inside else tested
    return again if any(_goes_on(term) for term in again.proof.final.terms) else tested


def with_middle_held_out(searched: Searched, term: Term) -> Searched | None:
    """The fits of a search with the middle of each recording held out; None unless ends of the same are.

    `term` is the reason, for the note.
    """
    prepared, final = searched.prepared, searched.final
    parts = _parts(prepared.train.runs, prepared.held_out.runs)
    if not parts:
        return None
    data, own = prepared.train.over(parts[0]), final.data.over(parts[0])
    if final.data is prepared.train:
        own = data
    elif final.data.apart:
        own = _apart(own, searched)
    note = (
        f"{HELD_OUT_NOTE} the middle of each recording is used for validation, since {title(term.effect)} goes on "
        "with time: its end lies outside the time of the rest."
    )
    notes = (*(one for one in prepared.notes if not one.startswith(HELD_OUT_NOTE)), note)
    inside: Prepared = replace(prepared, train=data, held_out=data.over(parts[1]), notes=notes)
    given, nominal = carried(data, searched.given), over(data, searched.nominal)
    return replace(searched, prepared=inside, given=given, nominal=nominal, final=over(own, final))


def _goes_on(term: Term) -> bool:
    return bool(BY_ID[term.effect].text.rate)


def _parts(train: Sequence[Measured], held_out: Sequence[Measured]) -> tuple[list[Measured], list[Measured]] | None:
    """Training recordings without their half beside the end that was held out, with that end; and these halves."""
    ends = {whole_name(run.name): run for run in held_out}
    outer, middle = list[Measured](), list[Measured]()
    for run in train:
        end = ends.pop(whole_name(run.name), None)
        if end is None:
            outer.append(run)
            continue
        ordered = in_turn([run, end])
        if not ordered:
            return None
        row = (run.evaluated.start + run.motor.size) // 2
        halves = run.until(row), replace(run, lead_in=row)
        first = ordered[0] is run
        outer += [halves[0], end] if first else [end, halves[1]]
        middle.append(replace(halves[1 if first else 0], name=f"{whole_name(run.name)} ({MIDDLE_PART})"))
    return None if ends or not middle else (outer, middle)


def _apart(data: Dataset, searched: Searched) -> Dataset:
    plain = fit_plain(data)
    reference: Fit = searched.nominal if searched.nominal.within_noise else searched.final
    return noise_apart(data, reference.hypothesis, plain) if plain else data
