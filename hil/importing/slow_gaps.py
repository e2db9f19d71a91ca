"""Stamps of single rows that came late, and gaps of a measurement that hardly moves within them."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.recording.clock_notes import LEAST_ROWS, span_text
from hil.recording.stamps import GAP_STEPS

_LATE = 1.0  # periods by which a stamp comes after the moment that the motion tells
_NEAR = 0.5  # periods between that moment and the row's turn
_CLEAR = 3.0  # times the deviation of nearly all rows from the line between their neighbours
_FEW = 0.01  # share of the rows: more are the jitter of a clock
_SHORT = 0.25  # share of the rows in parts that are too short to be kept
_SLOW = 0.01  # of the travel, within a gap
_INVENTED = 10.0  # rows on a line for each measured one: with more there is little but lines
_FILLED = 2.0  # periods: with more rows their median is less, and more steps would be gaps


def late_stamps(position: FloatArray, time_s: FloatArray) -> NDArray[np.intp]:
    """Rows whose position (n,) is that of one period after the row before, while their stamp is later; few or none."""
    period_s = float(np.median(np.diff(time_s))) if time_s.size > LEAST_ROWS else 0.0
    if period_s <= 0.0:
        return np.empty(0, dtype=np.intp)
    way, span_s = position[2:] - position[:-2], time_s[2:] - time_s[:-2]
    with np.errstate(divide="ignore", invalid="ignore"):
        told_s = (position[1:-1] - position[:-2]) / way * span_s  # after the row before, on the line to the next one
        off = np.abs(position[1:-1] - position[:-2] - way * (time_s[1:-1] - time_s[:-2]) / span_s)
    late = (time_s[1:-1] - time_s[:-2] - told_s > _LATE * period_s) & (np.abs(told_s - period_s) < _NEAR * period_s)
    rows = np.flatnonzero(late & (off > _CLEAR * np.nanquantile(off, 0.95))) + 1
    return rows if rows.size <= _FEW * position.size else rows[:0]


def moving_little(columns: Mapping[str, FloatArray], positions: Collection[str]) -> bool:
    """True if gaps would cut much of `columns` (n,) away and no position moves within them by 1 % of its travel."""
    steps = np.diff(columns["time_s"])
    period_s = float(np.median(steps))
    gaps = steps > GAP_STEPS * period_s
    parts = np.diff(np.r_[0, np.flatnonzero(gaps) + 1, steps.size + 1])
    if not positions or period_s <= 0.0 or parts[parts < LEAST_ROWS].sum() < _SHORT * steps.size:
        return False
    if steps[gaps].sum() > _INVENTED * steps.size * period_s:
        return False
    moved = {name: np.abs(np.diff(columns[name]))[gaps].max(initial=0.0) for name in positions}
    return all(change < _SLOW * np.ptp(columns[name]) for name, change in moved.items())


def with_gaps_filled(columns: Mapping[str, FloatArray]) -> tuple[dict[str, FloatArray], NDArray[np.intp], str]:
    """Columns (m,) with rows on the line over each gap, the row (n,) before each of them, and a note."""
    time_s = columns["time_s"]
    steps = np.diff(time_s)
    period_s = float(np.median(steps))
    gaps = steps > GAP_STEPS * period_s
    filled = np.where(steps > _FILLED * period_s, np.ceil(steps / period_s), 1.0).astype(np.intp)
    rows = np.r_[np.repeat(np.arange(steps.size), filled), steps.size]
    place = rows + np.r_[np.concatenate([np.arange(count) / count for count in filled]), 0.0]
    whole = np.arange(time_s.size)
    note = (
        f"clock: {gaps.sum()} gaps of up to {span_text(steps.max())} between steps of {span_text(period_s)}, "
        f"{steps[gaps].sum() / (time_s[-1] - time_s[0]):.0%} of the time, in which the axis hardly moves: the channels "
        "are interpolated over them; what changes faster than that is not in the recording"
    )
    return {name: np.interp(place, whole, values) for name, values in columns.items()}, rows, note
