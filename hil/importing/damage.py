"""Refuse columns that are damaged: many values missing, spikes, jumps, a sign that turns, rows out of order.

Notes tell jumps that are small beside the travel, as of a potentiometer that passes its gap, and a torque at a limit.
"""

from pathlib import Path

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.identification.derivatives import motion
from hil.importing.foreign_columns import FEW_MISSING
from hil.importing.foreign_table import ForeignTable
from hil.importing.relations import NO_SPREAD, driven, proportional, roughness
from hil.importing.roles import Roles
from hil.importing.slow_columns import rows_per_value
from hil.recording.stamps import GAP_STEPS

NO_ORDER = 1.0  # roughness from which rows have no order: 1.4 for white noise, below 0.3 for a motion
JUMP = 0.2  # of the travel in one row: no axis moves so far between two samples
FEW_VALUES = 20  # counts of an encoder at rest, where each count is a jump
_LISTED = 8  # jumps whose time is told
SUDDEN = 20.0  # times the change of the rows around: a fast motion is fast for more than one row
# A row in which a position moves so many times as far as in 95 % of the rows in motion, and the row before or after it
# less than half as far in this direction, is one of the sensor: an axis speeds up and brakes over several rows.
FAR, TOP, ALONE = 5.0, 0.95, 0.5
CLIPPED = 0.002  # share of the rows at the largest or least torque: without a limit one row has it, or a few in counts
TOLD = 0.8  # share of the torque that the motion of each half must explain before its sign is judged


def refuse_missing(table: ForeignTable, columns: dict[str, FloatArray]) -> None:
    """Refuse a column (n,) with text among its numbers, infinity, or many missing values. Raises InputError.

    A column of a slower rate (`rows_per_value`) has no missing values.
    """
    for name, values in columns.items():
        if name in table.texts:
            line, text = table.texts[name]
            number = f"number in {table.cell_units[name]} or a like unit" if name in table.cell_units else "number"
            raise InputError(
                f"{table.path}:{line}: {name} has text and no number: given {text!r}, allowed a {number} in each row; "
                "import the part of the file before it, or leave the column out by a map"
            )
        if np.isinf(values).any():
            row = int(np.argmax(np.isinf(values)))
            raise InputError(f"{table.place(row)}: {name} is infinite and no number; import the part before it")
        missing = np.isnan(values)
        if missing.mean() <= FEW_MISSING or rows_per_value(values):
            continue
        first = int(np.argmax(missing))
        after = " and never after" if 0 < first == np.sum(~missing) else ""
        scattered = np.median(np.diff(np.flatnonzero(~missing), prepend=-1)) > 1.0
        remedy = "export one rate, or leave it out by a map" if scattered else "import the part of the file before it"
        raise InputError(
            f"{table.path}: {name} has no number in {100.0 * missing.mean():.3g} % of the rows, first in "
            f"{table.place(first).removeprefix(f'{table.path}: ')}{after}; {remedy}"
        )


def refuse_damage(
    path: Path,
    raw: dict[str, FloatArray],
    time_s: FloatArray,
    even: dict[str, FloatArray],
    roles: Roles,
    period_s: float,
) -> None:
    """Check the columns that are used: `raw` as in the file, `even` on a regular clock. Raises InputError."""
    if roles.motor is not None and roughness(even[roles.motor]) > NO_ORDER:
        raise InputError(
            f"{path}: {roles.motor} jumps from row to row as if the rows were shuffled; sort the rows by time, or "
            "export the recording again"
        )
    command = roles.command or roles.unfollowed
    for position in filter(None, (roles.motor, roles.table, command)):
        _refuse_jumps(path, position, raw[position], time_s, steps=position == command)
    if roles.motor is None:
        return
    for position in filter(None, (roles.table, command)):
        _refuse_turned(path, position, even[position], roles.motor, even[roles.motor])
    for effort in filter(None, (roles.effort, roles.effort_command)):
        _refuse_turned_effort(path, effort, even[effort], roles.motor, even[roles.motor], period_s)


def jump_notes(name: str, values: FloatArray, time_s: FloatArray) -> list[str]:
    """Note on jumps of a position (n,) that the axis cannot make; empty without jumps."""
    change = _changes(values, time_s)
    steps = np.diff(time_s)
    if change.size and (usual_s := np.median(steps)) > 0.0:  # over a longer step the axis moves farther
        change = change / np.maximum(steps / usual_s, 1.0)
    size, way = np.abs(change), np.sign(change)
    moving = size[size > 0.0]
    if moving.size < FEW_VALUES:
        return []
    usual = float(np.quantile(moving, TOP))
    beside = np.minimum(way * np.r_[0.0, change[:-1]], way * np.r_[change[1:], 0.0])
    rows = np.flatnonzero((size > FAR * usual) & (beside < ALONE * size))
    if not rows.size:
        return []
    times = ", ".join(dict.fromkeys(f"{time_s[row] - time_s[0]:.1f}" for row in rows[:_LISTED]))
    more = " and later" if rows.size > _LISTED else ""
    return [
        f"{name}: jumps by up to {size[rows].max():.3g} in one row, after {times} s{more}, "
        f"{size[rows].max() / usual:.0f} times as far as in nearly all others: its sensor, not the axis; leave its "
        "values around there empty, or cut the file there"
    ]


def limit_notes(name: str, values: FloatArray) -> list[str]:
    """Note on a torque (n,) that stays at its largest or least value; empty for a command of few values."""
    if np.unique(values).size < FEW_VALUES:
        return []
    held = np.r_[False, np.diff(values) == 0.0]
    for limit in (values.max(), values.min()):
        share = float(np.mean(held & (values == limit)))
        if share > CLIPPED:
            return [
                f"{name}: stays at {limit:.4g} in {share:.1%} of the rows: a limit of the drive, or the end of the "
                "range of this channel; if the drive gave more, masses and friction come out too small"
            ]
    return []


def _changes(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """Change from row to row (n - 1,), 0 over gaps of the clock; empty for a column of few values."""
    if np.unique(values).size < FEW_VALUES:
        return np.empty(0)
    pause = np.diff(time_s)
    return np.where(pause > GAP_STEPS * np.median(pause), 0.0, np.diff(values))


def _refuse_jumps(path: Path, name: str, values: FloatArray, time_s: FloatArray, steps: bool) -> None:
    """Refuse jumps, and spikes (one row away from both neighbours). `steps` are allowed in a set-point."""
    change = _changes(values, time_s)
    size = np.abs(change)
    around = np.maximum(np.r_[0.0, 0.0, size[:-2]], np.r_[size[2:], 0.0, 0.0])[: size.size]
    jumps = np.flatnonzero((size > JUMP * np.ptp(values)) & (size > SUDDEN * around))
    if not jumps.size:
        return
    row = int(jumps[0])
    told = f"{path}: {name} jumps from {values[row]:.6g} to {values[row + 1]:.6g} in row {row + 2} of the numbers"
    if row + 1 < change.size and abs(change[row + 1] + change[row]) < 0.2 * size[row]:
        raise InputError(
            f"{told} and back: a spike or a placeholder for a missing value; correct the row or cut before it"
        )
    if not steps:
        raise InputError(f"{told}: rows are missing, or another recording follows; cut the file there")


def _refuse_turned(path: Path, name: str, values: FloatArray, motor: str, position: FloatArray) -> None:
    """Refuse a sign that turns within the recording, between the two halves."""
    half = values.size // 2
    first, last = (proportional(values[part], position[part]) for part in (slice(None, half), slice(half, None)))
    if min(first.share, last.share) > 0.9 and first.factor * last.factor < 0.0:
        raise InputError(
            f"{path}: {name} follows {motor} in one half of the file and its negative in the other: a sign was turned "
            "within the recording; cut the file there"
        )


def _refuse_turned_effort(
    path: Path, name: str, effort: FloatArray, motor: str, position: FloatArray, period_s: float
) -> None:
    """Refuse a torque that the same motion needs with the opposite sign in the second half."""
    half = effort.size // 2
    if min(np.ptp(position[:half]), np.ptp(position[half:])) < NO_SPREAD * np.ptp(position):
        return

    def share(values: FloatArray, part: slice) -> float:
        return driven(values[part], motion(position[part], period_s), period_s).share

    whole, turned = slice(None), np.concatenate([effort[:half], -effort[half:]])
    halves = min(share(effort, slice(None, half)), share(effort, slice(half, None)))
    if halves > TOLD and share(turned, whole) > share(effort, whole) + 0.5:
        raise InputError(
            f"{path}: {name} accelerates {motor} forwards in one half of the file and backwards in the other: a sign "
            "was turned within the recording; cut the file there"
        )
