"""Find samples that a logger repeated, and keep each of them once; find rows whose sample was lost.

A logger repeats all channels if it runs faster than the loop, one channel if that is sampled more slowly than the rest.
"""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

_REACH = 5  # rows on each side over which a channel must move
_FAST = 2.0  # least steps of a channel from row to row by which a motion is told from rest: each sample is new there
_STRAIGHT = 0.5  # of the path that a motion makes in one direction: noise goes to and fro
_MANY = 0.1  # share of repeated rows in motion: below, a few lost samples and no logger that is faster
_EVEN = 0.2  # deviation of the other steps from the usual one: noise and coarse counts make larger ones
_TWO = (1.7, 2.3)  # usual steps by which the row after a lost sample moves
# Most rows at which a column repeats alone, per row at which all repeat: so few of these are then repeated by chance.
_CHANCE = 0.05
_MOST = 0.5  # share of the rows at which all repeat that are caught up: nearly all after lost samples, else few
_LEAST_ROWS = 100  # in motion, for a share to a few per cent
_WHOLE = 0.02  # deviation from a whole ratio of the rates
_IN_STEP = 0.95  # share of the new samples at one phase of a whole ratio
_SEVERAL = 20  # new samples that tell this share of one column: of fewer, none may be off the phase


def rows_per_sample(columns: Mapping[str, FloatArray]) -> float:
    """Rows of columns (n,) for each sample of the loop: 1 without repetitions, 2 if each sample stands twice.

    Counted in rows in which a channel moves by several of its steps: no new sample repeats all channels there.
    """
    new, moving = _new(columns), _moving(columns)
    if moving.sum() < _LEAST_ROWS or np.mean(~new[moving]) < _MANY or lost_samples(columns)[~new & moving].all():
        return 1.0
    ratio = float(moving.sum() / max(new[moving].sum(), 1))
    return float(round(ratio)) if abs(ratio - round(ratio)) < _WHOLE * ratio else float(f"{ratio:.4g}")


def rows_per_slowest_sample(columns: Mapping[str, FloatArray], positions: Collection[str]) -> float:
    """Rows per sample of all columns (n,) together, or of the position that is sampled at the lowest rate.

    A position alone counts only at a whole ratio, with its new samples at regular rows.
    """
    alone = [rows_per_sample({name: columns[name]}) for name in positions]
    return max([rows_per_sample(columns), *(ratio for ratio in alone if slower(columns, ratio))])


def slower(columns: Mapping[str, FloatArray], ratio: float) -> list[str]:
    """Names of the columns (n,) that are sampled at every `ratio`-th row while others change between them.

    None at a ratio that is not whole, or if all columns repeat together.
    """
    if ratio == 1.0 or ratio != round(ratio) or _phase(columns, int(ratio)) is not None:
        return []
    return [name for name, values in columns.items() if _phase({name: values}, int(ratio), _SEVERAL) is not None]


def kept_rows(columns: Mapping[str, FloatArray], ratio: float) -> NDArray[np.intp]:
    """Rows to keep so that each sample stands once, for `ratio` rows per sample.

    At a whole ratio every so many rows from that at which most samples are new; else each new sample, and at rest,
    where samples do not differ, one row per `ratio`. Columns that are `slower` than the others tell which are new.
    """
    slow = slower(columns, ratio)
    columns = {name: columns[name] for name in slow} if slow else columns
    new = _new(columns)
    if ratio == round(ratio) and (phase := _phase(columns, int(ratio))) is not None:
        return np.arange(phase, new.size, int(ratio))
    longest = int(np.ceil(ratio))
    kept = [0]
    for row in range(1, new.size):
        if new[row] or row - kept[-1] >= longest:
            kept.append(row)
    return np.array(kept, dtype=np.intp)


def _phase(columns: Mapping[str, FloatArray], ratio: int, least: int = 1) -> int | None:
    """Phase (0 to `ratio` - 1) of the rows with new samples: row modulo `ratio`, equal for nearly all of a motion.

    None if they are spread over other rows, too, or fewer than `least`.
    """
    rows = np.flatnonzero(_new(columns) & _moving(columns))
    phases = np.bincount(rows % ratio, minlength=ratio)
    return int(phases.argmax()) if rows.size >= least and phases.max() > _IN_STEP * rows.size else None


def lost_samples(columns: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    """Rows (n,) of a motion in which a sample was lost: all columns repeat the row before, a later row catches up.

    If some column hardly ever repeats alone, and most of the rows at which all repeat are caught up, all of these are
    lost samples. Otherwise only those are that the next row catches up.
    """
    same, moving = ~_new(columns), _moving(columns)
    held = same & moving
    if not held.any():
        return held
    by_chance = min(np.sum(moving[1:] & ~same[1:] & (np.diff(values) == 0.0)) for values in columns.values())
    caught_up, judged = _caught_up(columns, np.flatnonzero(held), same)
    if by_chance <= _CHANCE * held.sum() and judged.any() and caught_up[judged].mean() >= _MOST:
        return held
    held[held] = caught_up
    return held


def _caught_up(
    columns: Mapping[str, FloatArray], rows: NDArray[np.intp], same: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """For each of the rows (k,): does the next row catch up, and can the rows around it tell that.

    The next row catches up if a column moves by equal steps around the row and by two of them in the step after it.
    Steps to and from other rows that repeat (`same`) do not count; at least `_REACH` others are needed.
    """
    around = rows[:, None] + np.array([offset for offset in range(-_REACH, _REACH) if offset not in (-1, 0)])
    counted = ~(same[around] | same[around + 1])
    total = counted.sum(axis=1)
    found = np.zeros(rows.size, dtype=np.bool_)
    for values in columns.values():
        steps = np.diff(values)
        usual = np.sum(steps[around] * counted, axis=1) / np.maximum(total, 1)
        size, way = np.abs(usual), np.sign(usual)
        even = (np.abs(steps[around] - usual[:, None]) * counted).max(axis=1) < _EVEN * size
        found |= even & (way * steps[rows] > _TWO[0] * size) & (way * steps[rows] < _TWO[1] * size)
    judged = total >= _REACH
    return np.asarray(found & judged), np.asarray(judged)


def _new(columns: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    """Rows (n,) that differ from the row before in any column."""
    rows = next(iter(columns.values()), np.zeros(0)).size
    new = np.zeros(rows, dtype=np.bool_)
    new[:1] = True
    for values in columns.values():
        new[1:] |= np.diff(values) != 0.0
    return new


def _moving(columns: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    """Rows (n,) at which a column moves by several of its steps per row in one direction."""
    moving = np.zeros(next(iter(columns.values()), np.zeros(0)).size, dtype=np.bool_)
    if moving.size <= 2 * _REACH:
        return moving
    for values in columns.values():
        size = np.abs(np.diff(values))
        if not size.any():
            continue
        path = np.convolve(size, np.ones(2 * _REACH), "valid")
        far = np.abs(values[2 * _REACH :] - values[: -2 * _REACH])
        moving[_REACH:-_REACH] |= (far > 2 * _REACH * _FAST * size[size > 0.0].min()) & (far > _STRAIGHT * path)
    return moving
