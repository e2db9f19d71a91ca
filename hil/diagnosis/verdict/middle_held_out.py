"""Hold out the middle of recordings instead of an end, where something goes on with time.

Motion that is held out has the speeds and places of training (`preparation.split`); an end has other times. There a
warm-up would be extrapolated, by a time constant that a part of it hardly tells.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from hil.diagnosis.moment_of_change import SteadyChange
from hil.diagnosis.stages import Judged, Prepared
from hil.diagnosis.wording import HELD_OUT_NOTE, MIDDLE_PART, part_of, whole_name
from hil.identification.dataset import in_turn
from hil.identification.measured import Measured
from hil.twin.library import BY_ID

_FRICTION = ("coulomb", "viscous")  # coefficients of the plain model


class _Parts(NamedTuple):
    """Recordings for training without their middle, and the middle of each."""

    train: list[Measured]
    middle: list[Measured]


def goes_on(judged: Judged) -> bool:
    """True if friction is left that changes steadily, and no mechanism is named whose law goes on with time."""
    changes = [one.question.change for one in judged.structure]
    left = any(isinstance(one, SteadyChange) and one.coefficient in _FRICTION for one in changes)
    return left and not _over_time(judged)


def names_more(again: Judged, judged: Judged) -> bool:
    """True if an answer names all that another one names, and a mechanism whose law goes on with time."""
    return bool(_over_time(again)) and _named(judged) <= _named(again)


def _named(judged: Judged) -> set[str]:
    return {term.effect for term in judged.final.terms} if judged.has_findings else set()


def _over_time(judged: Judged) -> set[str]:
    """Mechanisms that a report may tell as a rate."""
    return {effect for effect in _named(judged) if BY_ID[effect].text.rate}


def with_middle_held_out(prepared: Prepared) -> Prepared | None:
    """The same with the middle of each recording held out; None unless `split` held out ends alone."""
    ends = prepared.held_out.runs
    by_split = any(note.startswith(HELD_OUT_NOTE) for note in prepared.notes)
    inside = any(part_of(run.name) == MIDDLE_PART for run in ends)
    parts = _parts(prepared.train.runs, ends) if by_split and not inside else None
    if parts is None:
        return None
    data = prepared.train.over(parts.train)
    note = (
        f"{HELD_OUT_NOTE} the middle of each recording is used for validation, since something goes on changing with "
        "time, and the end is outside the time of the rest."
    )
    notes = (*(one for one in prepared.notes if not one.startswith(HELD_OUT_NOTE)), note)
    return replace(prepared, train=data, held_out=data.over(parts.middle), notes=notes)


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
