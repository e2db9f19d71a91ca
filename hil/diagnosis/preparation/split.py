"""Split of recordings into a part for training and a part that is held out."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.diagnosis.wording import FIRST_PART, HELD_OUT_NOTE, LAST_PART, MIDDLE_PART, part_of
from hil.identification.measured import LEAD_IN
from hil.recording.recording import Recording

# Begin and end of what is held out, as shares of the motion; of equal cuts the first is taken. Two thirds for training
# is a common split. The third before the middle comes last: even of a single stroke it has the places and the speeds
# of the rest, but cuts it in two.
CUTS = ((2.0 / 3.0, 1.0), (0.0, 1.0 / 3.0), (0.5, 1.0), (0.0, 0.5), (1.0 / 6.0, 0.5))
# Least top speed in training over that held out, and least share of the rows held out at positions of the training:
# beyond, friction and inertia, or what depends on the place, would be extrapolated.
_COVERED = 0.8
_BOTH_WAYS = 0.1  # of the travel, forwards and backwards: less tells no lost motion and no load from friction
_STARTED = 0.01  # of the travel: above noise and drift of an axis at rest
_LONG_REST = 0.2  # of the recording: a third keeps less than half of its motion
_SPEED_S = 0.02  # time over which a speed is averaged: many counts of an encoder


class _Cut(NamedTuple):
    """The parts of a recording for training, in order of time, the part held out, and the travel of all of it."""

    train: tuple[Recording, ...]
    held_out: Recording
    travel: float


def split(
    recordings: Sequence[Recording], usable: Callable[[Sequence[Recording]], bool] = bool
) -> tuple[list[Recording], list[Recording]]:
    """Split each recording into one or two parts of its motion for training and one held out, by the best of `CUTS`.

    All keep their time. By the best cut all parts are `usable` (default: every part is), training is as fast as what is
    held out, moves both ways (of motion in one direction friction and a load are one offset) and goes as far, and what
    is held out moves both ways, in this order. A part that begins in motion has rows before it, from which the twin
    gets its state there: every row is evaluated in one part.
    """
    train, rest = list[Recording](), list[Recording]()
    for recording in recordings:
        ranked = sorted((_cut(recording, *shares) for shares in CUTS), key=_merits, reverse=True)
        led = [[_led_in(recording, part) for part in (*parts.train, parts.held_out)] for parts in ranked]
        *parts, held_out = next(filter(usable, led), led[0])
        train += parts
        rest.append(held_out)
    return train, rest


def _cut(recording: Recording, first: float, last: float) -> _Cut:
    """Cut out what is between two shares of the motion, at rest near them."""
    (begin, end), travel = _moving(recording), float(np.ptp(_position(recording)))
    row, stop = (_standstill(recording, begin + round(share * (end - begin))) for share in (first, last))
    before, after = _part(recording, slice(0, row), FIRST_PART), _part(recording, slice(stop, None), LAST_PART)
    if first <= 0.0:
        return _Cut((after,), _part(recording, slice(0, stop), FIRST_PART), travel)
    if last >= 1.0:
        return _Cut((before,), _part(recording, slice(row, None), LAST_PART), travel)
    return _Cut((before, after), _part(recording, slice(row, stop), MIDDLE_PART), travel)


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
    other = [one.name for one in held_out if part_of(one.name) != LAST_PART]
    text = f"{HELD_OUT_NOTE} the last part of each recording is used for validation"
    return (
        f"{text}, but {', '.join(other)}, since the rest alone reaches its speed and travel." if other else f"{text}."
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


def _merits(parts: _Cut) -> tuple[bool, ...]:
    """What is good about a cut, the most important first (see `split`)."""
    return (
        max(map(_top_speed, parts.train)) >= _COVERED * _top_speed(parts.held_out),
        _moves_both_ways(parts.train, parts.travel),
        _within(parts) >= _COVERED,
        _moves_both_ways([parts.held_out], parts.travel),
    )


def _within(parts: _Cut) -> float:
    """Share of the rows held out that lie where training was, but for noise and drift (see `_STARTED`)."""
    known, there = np.concatenate([*map(_position, parts.train)]), _position(parts.held_out)
    if not known.size or not there.size:
        return 0.0
    margin = _STARTED * parts.travel
    return float(np.mean((there >= np.min(known) - margin) & (there <= np.max(known) + margin)))


def _moves_both_ways(parts: Sequence[Recording], travel: float) -> bool:
    """True if parts move forwards and backwards by a share of the travel (in the unit of the position)."""
    moves = [position for position in map(_position, parts) if position.size]
    forwards = max((float(np.max(one - np.minimum.accumulate(one))) for one in moves), default=0.0)
    backwards = max((float(np.max(np.maximum.accumulate(one) - one)) for one in moves), default=0.0)
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
