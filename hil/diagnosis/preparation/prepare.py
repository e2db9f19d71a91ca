"""Prepare recordings for a diagnosis: check the control law, complete channels, split, refuse, build the data sets."""

from collections.abc import Sequence

from hil.bench.bench_file import Bench
from hil.diagnosis.preparation.law_check import check_law
from hil.diagnosis.preparation.preflight import preflight
from hil.diagnosis.preparation.split import held_out_note, same, split
from hil.diagnosis.preparation.usable_law import at_set_points, replayable
from hil.diagnosis.preparation.usable_parts import usable_parts
from hil.diagnosis.stages import Prepared
from hil.errors import InputError
from hil.identification.dataset import prepare_dataset
from hil.identification.derived_channels import completed, reduced
from hil.recording.recording import NOMINAL, Recording


def prepare(train: Sequence[Recording], validate: Sequence[Recording], bench: Bench) -> Prepared:
    """Prepare recordings, cut at their gaps; without `validate` a third of each is held out.

    Raises InputError with all reasons if the recordings cannot be diagnosed.
    """
    told = train[0].metadata.get(NOMINAL, {}) if train else {}
    parts, proof = usable_parts(train, bench, not validate), usable_parts(validate, bench, False)
    notes = (*parts.notes, *proof.notes)
    train, whole, validate = list(parts.recordings), list(parts.whole), list(proof.recordings or parts.held_out)
    law = replayable(bench, [*train, *whole, *validate])
    train, whole, validate = ([law.marked(run) for run in runs] for runs in (train, whole, validate))
    usable = reduced(law.bench, [*train, *whole, *validate])
    train, whole, validate = ([completed(run, usable) for run in runs] for runs in (train, whole, validate))
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
    measured = preflight(runs, usable).accepted()
    if usable.law_known:
        law = at_set_points(measured, usable)
        law = check_law(measured[: len(train)], usable) if law.bench is usable else law
        law = law.beside(measured)
        if law.bench is not usable:
            usable = reduced(law.bench, runs)
            measured = preflight(runs, usable).accepted()
    measured = law.without_command(measured)
    data = prepare_dataset(measured[: len(train)], usable)
    return Prepared(data, data.over(measured[len(train) :]), usable, bench, law, (*notes, *law.notes), told)
