"""Split of recordings into a part for training and a part that is held out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.recording.recording import Recording

TRAINED = 2.0 / 3.0  # share of a recording for training if none is held out: a common split


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Split each recording into the first two thirds and the rest, which keeps its time."""
    train, rest = [], []
    for recording in recordings:
        cut = _standstill(recording, round(TRAINED * len(recording)))
        train.append(_part(recording, slice(0, cut), "first part"))
        rest.append(_part(recording, slice(cut, None), "last part"))
    return train, rest


def same(one: Recording, other: Recording) -> bool:
    """True if two recordings have the same samples."""
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(values, other[name]) for name, values in one.columns.items()
    )


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
