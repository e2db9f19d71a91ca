"""Channels with clocks of their own: a column of time beside each channel, or each group of channels of one rate.

Such channels are merged by their stamps, never by their rows.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.importing.clock import StampClock, clock_of, time_columns
from hil.importing.column_names import Label
from hil.importing.foreign_table import ForeignTable
from hil.importing.header_values import HeaderValue
from hil.importing.lexicon import Constant, Quantity
from hil.importing.map_file import TimeColumn
from hil.importing.stamp_columns import counted_on, growing

_CHANNELS = (Quantity.POSITION, Quantity.VELOCITY, Quantity.EFFORT)
_ROW = 0.01  # of a step: by which two clocks of the same rows differ at most


@dataclass(frozen=True)
class OwnClocks:
    """Table on the clock of one group of channels; columns of time of the others by channel; notes."""

    table: ForeignTable
    times: dict[str, TimeColumn] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def on_one_clock(table: ForeignTable, labels: dict[str, Label]) -> OwnClocks:
    """Put channels with clocks of their own on that of the position."""
    groups = _groups(table, labels)
    # stamps before a number of the message only are others of the same rows
    groups = [group for group in groups if any(labels[name].sure for name in group[1])] or groups
    if len(groups) < 2:
        return OwnClocks(table)
    clocks = [_clock(table, labels, *group) for group in groups]
    if any(clock is None for clock in clocks):
        return OwnClocks(table)
    found = [clock for clock in clocks if clock is not None]
    main = min(range(len(groups)), key=lambda index: _rank(labels, groups[index][1]))
    others = [index for index in range(len(groups)) if not _same(found[index], found[main])]
    unused = {name for index, (times, _) in enumerate(groups) if index != main for name in times}
    columns = {name: values for name, values in table.columns.items() if name not in unused}
    if not others:
        return OwnClocks(replace(table, columns=columns))
    time = found[main].time
    assert time is not None
    own = {name: found[index].time for index in others for name in groups[index][1]}
    times = {name: one for name, one in own.items() if one is not None}
    merged, kept = merge(table.path, table.columns, time, times)
    columns = {name: merged[name] for name in columns}
    steps = {index: _step_text(found[index]) for index in (main, *others)}
    notes = tuple(
        f"clock: {', '.join(groups[index][1])} has its own stamps ({steps[index]}); it is interpolated to those of "
        f"{', '.join(groups[main][1])} ({steps[main]})"
        for index in others
    )
    lines = table.lines[kept] if table.lines is not None else None
    rate = _told(table, groups[main][1])
    constants = table.constants | ({Constant.RATE: rate} if rate else {})
    return OwnClocks(replace(table, columns=columns, lines=lines, constants=constants), times, notes)


def merge(
    path: Path, columns: Mapping[str, FloatArray], time: TimeColumn, times: Mapping[str, TimeColumn]
) -> tuple[dict[str, FloatArray], NDArray[np.intp]]:
    """Columns (n,) on the clock `time`, and the rows that are kept: those between the first and last stamps of all.

    Columns of `times` are interpolated by their own stamps; NaN ends a column of fewer rows. Raises InputError: stamps
    without a time in common.
    """
    first = float(columns[time.column][np.isfinite(columns[time.column])][0])
    at_s = seconds(columns, time, first)
    merged = dict(columns)
    kept = np.isfinite(at_s)
    for name, own in times.items():
        own_s = seconds(columns, own, first * time.seconds / own.seconds)
        good = np.isfinite(own_s) & np.isfinite(columns[name])
        order = np.argsort(own_s[good], kind="stable")
        merged[name] = np.interp(at_s, own_s[good][order], columns[name][good][order])
        kept &= (at_s >= own_s[good].min(initial=np.inf)) & (at_s <= own_s[good].max(initial=-np.inf))
    rows = np.flatnonzero(kept)
    if not rows.size:
        raise InputError(
            f"{path}: the stamps of {listed([time.column, *dict.fromkeys(own.column for own in times.values())])} have "
            "no time in common, allowed those of one recording; write the unit of each into a map"
        )
    return {name: values[rows] for name, values in merged.items()}, rows


def seconds(columns: Mapping[str, FloatArray], time: TimeColumn, start: float = 0.0) -> FloatArray:
    """Stamps (n,) [s] of a column less `start`, in its unit, with the fraction of a second."""
    stamps = (counted_on(columns[time.column], time.wraps_at) - start) * time.seconds
    part = time.fraction
    return np.asarray(stamps + part.seconds * columns[part.column] if part else stamps, dtype=np.float64)


def _groups(table: ForeignTable, labels: dict[str, Label]) -> list[tuple[list[str], list[str]]]:
    """Columns of time with the channels that follow them, or that come before them if the first column is no time."""
    times = set(time_columns(table, labels))
    names = list(table.columns)
    if names and names[0] not in times and names[-1] in times:
        names = names[::-1]
    groups: list[tuple[list[str], list[str]]] = []
    for name in names:
        if name in times:
            if not groups or groups[-1][1]:
                groups.append(([], []))
            groups[-1][0].append(name)
        elif groups:
            groups[-1][1].append(name)
    groups = [group for group in groups if group[1]]
    # a counter of rows between two columns of time is no group of channels
    useful = [group for group in groups if any(labels[name].quantity in _CHANNELS for name in group[1])]
    return useful or groups


def _clock(table: ForeignTable, labels: dict[str, Label], times: list[str], channels: list[str]) -> StampClock | None:
    """Clock of one group, on the rows that it has."""
    rate = _told(table, channels)
    told = (rate.value, rate.text) if rate else None
    stamped = np.logical_or.reduce([np.isfinite(table.columns[name]) for name in times])
    part = replace(table, columns={name: table.columns[name][stamped] for name in times}, lines=None)
    return clock_of(part, labels, [name for name in times if growing(part.columns[name])], told)


def _told(table: ForeignTable, channels: list[str]) -> HeaderValue | None:
    """Rate of a group of channels by the header."""
    given = [(name, table.periods_s[name]) for name in channels if name in table.periods_s]
    return (
        HeaderValue(1.0 / given[0][1], f"the header gives {given[0][0]} a period of {given[0][1]:g} s")
        if given
        else None
    )


def _rank(labels: dict[str, Label], channels: list[str]) -> int:
    """The measured position comes first, then a velocity, then set-points."""
    order = {Quantity.POSITION: 0, Quantity.VELOCITY: 2}
    return min(order.get(labels[name].quantity, 4) + labels[name].command for name in channels)


def _same(one: StampClock, other: StampClock) -> bool:
    """True if two clocks have the same stamps in the same rows."""
    if one.time_s.size != other.time_s.size:
        return False
    step_s = np.ptp(other.time_s) / max(other.time_s.size - 1, 1)
    return bool(np.abs(one.time_s - other.time_s).max() <= _ROW * step_s)


def _step_text(clock: StampClock) -> str:
    return f"{clock.time_s.size} rows in {np.ptp(clock.time_s):.4g} s"
