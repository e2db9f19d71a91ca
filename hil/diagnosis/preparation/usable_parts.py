"""Take the parts of recordings with gaps that can be diagnosed, and say which are left out."""

from collections.abc import Sequence
from dataclasses import dataclass

from hil.bench.bench_file import Bench
from hil.diagnosis.preparation.preflight import preflight
from hil.diagnosis.preparation.split import split
from hil.diagnosis.preparation.usable_law import replayable
from hil.errors import InputError
from hil.identification.derived_channels import reduced
from hil.recording.recording import Recording


@dataclass(frozen=True)
class UsableParts:
    """Recordings without gaps; `whole` are those of which no piece can be held out; notes on what was cut.

    `held_out` is a part that is held out as a whole, because none can be split.
    """

    recordings: tuple[Recording, ...]
    whole: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    notes: tuple[str, ...]


def usable_parts(recordings: Sequence[Recording], bench: Bench, to_split: bool) -> UsableParts:
    """Cut recordings at their gaps and keep the parts that can be diagnosed; `to_split`: a third is held out of each.

    A part of which no third can be held out is trained on as a whole; if that is all parts, the last is held out. A
    recording without gaps stays as it is. Raises InputError if no part of a recording can be diagnosed, with the
    reason of the longest.
    """
    kept, whole, notes = list[Recording](), list[Recording](), list[str]()
    for recording in recordings:
        parts = recording.parts()
        if len(parts) == 1:
            kept.append(recording)
            continue
        reasons = {part.name: _reason([part], bench) for part in parts}
        usable = [part for part in parts if not reasons[part.name]]
        if not usable:
            longest = max(parts, key=len)
            raise InputError(
                f"{recording.name}: gaps cut it into {len(parts)} parts, none usable: {reasons[longest.name]}"
            )
        pieces = {part.name: [one for half in split([part]) for one in half] for part in usable if to_split}
        unsplit = [part for part in usable if to_split and _reason(pieces[part.name], bench)]
        kept += [part for part in usable if part not in unsplit]
        whole += unsplit
        notes.append(
            f"{recording.name}: gaps in time cut it into {len(parts)} parts; used are "
            f"{', '.join(f'{part.name} from {part.start_s:.4g} s' for part in usable)}"
        )
        notes += [f"Left out: {reason}" for reason in reasons.values() if reason]
    if kept or len(whole) < 2:  # of a single part that cannot be split the check of its pieces says why
        return UsableParts(tuple(kept or whole), tuple(whole if kept else ()), (), tuple(notes))
    notes.append(f"No part is long enough to hold out a third of it: {whole[-1].name} is held out as a whole.")
    return UsableParts(tuple(whole[:-1]), (), (whole[-1],), tuple(notes))


def _reason(parts: Sequence[Recording], bench: Bench) -> str:
    """Why parts cannot be diagnosed, in one line; empty if they can."""
    law = replayable(bench, parts)
    problems = preflight([law.marked(part) for part in parts], reduced(law.bench, parts)).problems
    return problems[0].splitlines()[0] if problems else ""
