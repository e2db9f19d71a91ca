"""Split of recordings into a part for training and a part that is held out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.diagnosis.wording import FIRST_PART, HELD_OUT_NOTE, LAST_PART
from hil.identification.measured import LEAD_IN
from hil.recording.recording import Recording

# Share of the motion before the cut, and whether the part after it is held out; the first that fits is taken. Two
# thirds for training is a common split.
CUTS = ((2.0 / 3.0, True), (1.0 / 3.0, False), (0.5, True), (0.5, False))
# Least top speed in training over that held out, and least share of the rows held out at positions of the training:
# beyond, friction and inertia, or what depends on the place, would be extrapolated.
_COVERED = 0.8
_BOTH_WAYS = 0.1  # of the travel, forwards and backwards: less tells no lost motion and no load from friction
_STARTED = 0.01  # of the travel: above noise and drift of an axis at rest
_LONG_REST = 0.2  # of the recording: a third keeps less than half of its motion
_SPEED_S = 0.02  # time over which a speed is averaged: many counts of an encoder


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Split each recording into a part of its motion for training and one that is held out, as `CUTS` order them.

    Both keep their time. The training part is as fast as the other and goes as far, and both move both ways, where a
    cut makes it so; else the training part does: of motion in one direction friction and a load are one offset. A part
    that begins in motion has rows before it, from which the twin gets its state there: every row is evaluated in one
    part.
    """
    train, rest = [], []
    for recording in recordings:
        begin, end = _moving(recording)
        travel = float(np.ptp(_position(recording)))
        found = [_cut(recording, begin + round(share * (end - begin)), last) for share, last in CUTS]
        fast = [parts for parts in found if _covers(*parts)] or found[:1]
        told = [parts for parts in fast if _moves_both_ways(parts[0], travel)] or fast
        inside = [parts for parts in told if _within(*parts, travel) >= _COVERED] or told
        parts = next((parts for parts in inside if _moves_both_ways(parts[1], travel)), inside[0])
        train.append(_led_in(recording, parts[0]))
        rest.append(_led_in(recording, parts[1]))
    return train, rest


def _cut(recording: Recording, row: int, last: bool) -> tuple[Recording, Recording]:
    """Return the part for training and the one held out, cut at rest near a row; `last`: the last one is held out."""
    cut = _standstill(recording, row)
    parts = _part(recording, slice(0, cut), FIRST_PART), _part(recording, slice(cut, None), LAST_PART)
    return parts if last else (parts[1], parts[0])


def _led_in(recording: Recording, part: Recording) -> Recording:
    """The part, and as many rows before it as it has itself if they are recorded; unchanged if it begins at rest.

    They are simulated and not evaluated: a flexible load, which swings at the cut, has an unknown state there.
    """
    first = round((part.start_s - recording.start_s) / recording.period_s)
    lead = min(first, len(part))
    if not lead or _rests(recording)[first]:
        return part
    longer = _part(recording, slice(first - lead, first + len(part)), "")
    return replace(longer, name=part.name, metadata=part.metadata | {LEAD_IN: lead})


def held_out_note(held_out: Sequence[Recording]) -> str:
    """Sentence on the parts that `split` holds out."""
    first = [one.name for one in held_out if one.name.endswith(f"({FIRST_PART})")]
    text = f"{HELD_OUT_NOTE} the last part of each recording is used for validation"
    return (
        f"{text}, but {', '.join(first)}, since the rest alone reaches its speed and travel." if first else f"{text}."
    )


def same(one: Recording, other: Recording) -> bool:
    """True if two recordings have the same samples."""
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(values, other[name]) for name, values in one.columns.items()
    )


def _moving(recording: Recording) -> tuple[int, int]:
    """First row and end of the motion, where a long rest before or after it would be most of a third."""
    position = _position(recording)
    away = np.abs(position - position[0]) > _STARTED * np.ptp(position)
    back = np.abs(position - position[-1]) > _STARTED * np.ptp(position)
    begin, rest = int(np.argmax(away)), int(np.argmax(back[::-1]))
    return (begin, len(recording) - rest) if max(begin, rest) > _LONG_REST * len(recording) else (0, len(recording))


def _position(recording: Recording) -> FloatArray:
    """Position (n,) of the motor, or of the table without it; zeros without both."""
    names = recording.axis
    given = (recording.columns.get(name) for name in (names.motor_position, names.table_position))
    return next((values for values in given if values is not None), np.zeros(len(recording)))


def _covers(train: Recording, held_out: Recording) -> bool:
    """True if the training part is about as fast as the part that is held out."""
    return _top_speed(train) >= _COVERED * _top_speed(held_out)


def _within(train: Recording, held_out: Recording, travel: float) -> float:
    """Share of the rows held out that lie where the training part was, but for noise and drift (see `_STARTED`)."""
    known, there, margin = _position(train), _position(held_out), _STARTED * travel
    if not known.size or not there.size:
        return 0.0
    return float(np.mean((there >= np.min(known) - margin) & (there <= np.max(known) + margin)))


def _moves_both_ways(part: Recording, travel: float) -> bool:
    """True if a part moves forwards and backwards by a share of the travel (in the unit of the position)."""
    position = _position(part)
    if not position.size:
        return False
    forwards = float(np.max(position - np.minimum.accumulate(position)))
    backwards = float(np.max(np.maximum.accumulate(position) - position))
    return min(forwards, backwards) > _BOTH_WAYS * travel


def _top_speed(recording: Recording) -> float:
    """Largest speed of the motor, or of the table without it, averaged over some rows [1/s]."""
    position = _position(recording)
    rows = max(round(_SPEED_S / recording.period_s), 1)
    if position.size <= rows:
        return 0.0
    return float(np.max(np.abs(position[rows:] - position[:-rows]))) / (rows * recording.period_s)


def _standstill(recording: Recording, row: int) -> int:
    """Return the row at rest nearest to `row`; `row` itself if none is within a tenth of the recording."""
    still = np.flatnonzero(_rests(recording))
    near = still[np.abs(still - row) < 0.1 * len(recording)]
    return int(near[np.argmin(np.abs(near - row))]) if near.size else row


def _rests(recording: Recording) -> NDArray[np.bool_]:
    """Rows (n,) at which the set-points rest, all without set-points."""
    speed = recording.columns.get(recording.axis.velocity_command)
    return np.ones(len(recording), dtype=bool) if speed is None else speed == 0.0


def _part(recording: Recording, rows: slice, what: str) -> Recording:
    columns = {name: values[rows] for name, values in recording.columns.items()}
    start_s = recording.start_s + (rows.start or 0) * recording.period_s
    return replace(recording, name=f"{recording.name} ({what})", columns=columns, start_s=start_s)
