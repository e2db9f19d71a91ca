"""Split of recordings into a part for training and a part that is held out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.recording.recording import Recording

TRAINED = 2.0 / 3.0  # share of a recording for training if none is held out: a common split
_COVERED = 0.8  # least top speed in training over that held out: beyond, friction and inertia would be extrapolated
_FIRST, _LAST = "first part", "last part"
_SPEED_S = 0.02  # time over which a speed is averaged: many counts of an encoder


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Split each recording into two thirds for training and one third that is held out; both keep their time.

    The last third is held out, or the first one where only the last one is fast.
    """
    train, rest = [], []
    for recording in recordings:
        cut = _standstill(recording, round(TRAINED * len(recording)))
        parts = _part(recording, slice(0, cut), _FIRST), _part(recording, slice(cut, None), _LAST)
        if not _covers(*parts):
            cut = _standstill(recording, round((1.0 - TRAINED) * len(recording)))
            other = _part(recording, slice(cut, None), _LAST), _part(recording, slice(0, cut), _FIRST)
            parts = other if _covers(*other) else parts
        train.append(parts[0])
        rest.append(parts[1])
    return train, rest


def held_out_note(held_out: Sequence[Recording]) -> str:
    """Sentence on the parts that `split` holds out."""
    first = [one.name for one in held_out if one.name.endswith(f"({_FIRST})")]
    text = "No held-out recording was given: the last third of each recording is used for validation"
    return f"{text}, but {', '.join(first)}, since only the rest reaches the full speed." if first else f"{text}."


def same(one: Recording, other: Recording) -> bool:
    """True if two recordings have the same samples."""
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(values, other[name]) for name, values in one.columns.items()
    )


def _covers(train: Recording, held_out: Recording) -> bool:
    """True if the training part is about as fast as the part that is held out."""
    return _top_speed(train) >= _COVERED * _top_speed(held_out)


def _top_speed(recording: Recording) -> float:
    """Largest speed of the motor, or of the table without it, averaged over some rows [1/s]."""
    names = recording.axis
    position = recording.columns.get(names.motor_position, recording.columns.get(names.table_position))
    rows = max(round(_SPEED_S / recording.period_s), 1)
    if position is None or position.size <= rows:
        return 0.0
    return float(np.max(np.abs(position[rows:] - position[:-rows]))) / (rows * recording.period_s)


def _standstill(recording: Recording, row: int) -> int:
    """Return the row at rest nearest to `row`; `row` itself if none is within a tenth of the recording."""
    names = recording.axis
    if names.velocity_command not in recording.columns:
        return row
    still = np.flatnonzero(recording[names.velocity_command] == 0.0)
    near = still[np.abs(still - row) < 0.1 * len(recording)]
    return int(near[np.argmin(np.abs(near - row))]) if near.size else row


def _part(recording: Recording, rows: slice, what: str) -> Recording:
    columns = {name: values[rows] for name, values in recording.columns.items()}
    start_s = recording.start_s + (rows.start or 0) * recording.period_s
    return replace(recording, name=f"{recording.name} ({what})", columns=columns, start_s=start_s)
