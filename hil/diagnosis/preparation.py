"""Prepare recordings for a diagnosis: check the control law, complete channels, split, refuse, build the data sets."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil.bench.bench_file import Bench
from hil.diagnosis.law_check import LawCheck, check_law, replayable
from hil.diagnosis.preflight import prepare
from hil.diagnosis.split import same, split
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
    """Prepare recordings; without `validate` the last third of each is held out.

    Raises InputError with all reasons if the recordings cannot be diagnosed.
    """
    notes: tuple[str, ...] = ()
    law = replayable(bench, [*train, *validate])
    train, validate = ([law.marked(run) for run in runs] for runs in (train, validate))
    judged = reduced(law.bench, [*train, *validate])
    train, validate = ([completed(run, judged) for run in runs] for runs in (train, validate))
    if not validate:
        train, validate = split(train)
        notes = ("No held-out recording was given: the last third of each recording is used for validation.",)
    twice = [held.name for held in validate for run in train if same(held, run)]
    if twice:
        raise InputError(
            f"--validate: given {', '.join(twice)}, which is a training recording too, allowed recordings "
            "of another motion; leave it out of one of them"
        )
    runs = [*train, *validate]
    prepared = prepare(runs, judged)
    if judged.law_known:
        law = check_law(prepared[: len(train)], judged)
        if law.bench is not judged:
            judged = reduced(law.bench, runs)
            prepared = prepare(runs, judged)
    prepared = law.judged(prepared)
    data = prepare_dataset(prepared[: len(train)], judged)
    return Prepared(data, data.over(prepared[len(train) :]), judged, law, (*notes, *law.notes))
