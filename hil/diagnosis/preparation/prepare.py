"""Prepare recordings for a diagnosis: check the control law, complete channels, split, refuse, build the data sets."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil.bench.bench_file import Bench
from hil.diagnosis.preparation.law_check import check_law
from hil.diagnosis.preparation.preflight import prepare
from hil.diagnosis.preparation.split import held_out_note, same, split
from hil.diagnosis.preparation.usable_law import LawCheck, at_set_points, replayable
from hil.diagnosis.preparation.usable_parts import usable_parts
from hil.errors import InputError
from hil.identification.completion import completed, reduced
from hil.identification.dataset import Dataset, prepare_dataset
from hil.recording.recording import Recording


@dataclass(frozen=True)
class Prepared:
    """Data sets for training and validation, the bench with the control law that may be used, and notes."""

    train: Dataset
    held_out: Dataset  # without runs if nothing was held out
    bench: Bench
    law: LawCheck
    notes: tuple[str, ...]


def prepare_diagnosis(train: Sequence[Recording], validate: Sequence[Recording], bench: Bench) -> Prepared:
    """Prepare recordings, cut at their gaps; without `validate` a third of each is held out.

    Raises InputError with all reasons if the recordings cannot be diagnosed.
    """
    usable, proof = usable_parts(train, bench, not validate), usable_parts(validate, bench, False)
    notes = (*usable.notes, *proof.notes)
    train, whole, validate = list(usable.recordings), list(usable.whole), list(proof.recordings or usable.held_out)
    law = replayable(bench, [*train, *whole, *validate])
    train, whole, validate = ([law.marked(run) for run in runs] for runs in (train, whole, validate))
    judged = reduced(law.bench, [*train, *whole, *validate])
    train, whole, validate = ([completed(run, judged) for run in runs] for runs in (train, whole, validate))
    if not validate:
        train, validate = split(train)
        train += whole
        notes = (*notes, held_out_note(validate))
    twice = [held.name for held in validate for run in train if same(held, run)]
    if twice:
        raise InputError(
            f"--validate: given {', '.join(twice)}, which is a training recording too, allowed recordings "
            "of another motion; leave it out of one of them"
        )
    runs = [*train, *validate]
    prepared = prepare(runs, judged)
    if judged.law_known:
        law = at_set_points(prepared, judged)
        law = check_law(prepared[: len(train)], judged) if law.bench is judged else law
        if law.bench is not judged:
            judged = reduced(law.bench, runs)
            prepared = prepare(runs, judged)
    prepared = law.judged(prepared)
    data = prepare_dataset(prepared[: len(train)], judged)
    return Prepared(data, data.over(prepared[len(train) :]), judged, law, (*notes, *law.notes))
