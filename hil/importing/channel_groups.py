"""Groups of channels, each with a clock of its own, as columns of one length: what files of several rates have.

Groups of a file that are runs of one axis, one after the other, are one group: the same channels under names of runs.
"""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hil.files.input_file import check_values

CLOCK = "time"  # channel of stamps that have no name in the file
_RUN = re.compile(
    r"(?:run|test|trial|scan|meas|measurement|messung|versuch|fahrt|essai|prueba)[ _.-]*\d+", re.IGNORECASE
)
_APART = 100  # rows between two runs, more than a gap that is interpolated
_FEWEST = 2  # channels: position and torque


class Group(NamedTuple):
    """Channels of one group of a file: values (n,) or (n, k) by name, their units by the same names.

    has_clock: the first channel are the stamps of the others.
    """

    name: str
    channels: dict[str, Any]
    units: dict[str, str]
    has_clock: bool = True


def one_length(path: Path, groups: Iterable[Group]) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns and units of all groups, one after the other; of groups with clocks the shorter ones end with NaN.

    A name that several groups have becomes GROUP.NAME. Raises InputError for too many values.
    """
    groups = _runs_joined([group for group in groups if len(group.channels) > group.has_clock])
    times = Counter(name for group in groups for name in group.channels)
    clocked = [group for group in groups if group.has_clock]
    rows = max((len(values) for group in clocked for values in group.channels.values()), default=0)
    if len(clocked) > 1:
        width = sum(len(group.channels) for group in clocked)
        check_values(path, rows * width, f"{width} channels of up to {rows} rows")
    arrays, units = dict[str, Any](), dict[str, str]()
    for group in groups:
        for name, values in group.channels.items():
            own = unique = name if times[name] == 1 else f"{group.name}.{name}"
            number = 2
            while unique in arrays:
                unique, number = f"{own} {number}", number + 1
            arrays[unique] = _ended(values, rows) if group.has_clock else values
            if unit := group.units.get(name):
                units[unique] = unit
    return arrays, units


def _runs_joined(groups: Sequence[Group]) -> list[Group]:
    """The groups, those that are runs with the same channels as one, with a gap between each two of them.

    Stamps that begin anew go on after the gap; without stamps it is rows without values.
    """
    runs = [one for one in groups if _RUN.fullmatch(one.name.rpartition(".")[2]) and _is_table(one)]
    alike = [one for one in runs if _says(one) == _says(runs[0])]
    if len(alike) < 2 or len(alike) < len(groups) or not _in_turn(alike):
        return list(groups)
    first = alike[0]
    joined = {name: np.asarray(first.channels[name], dtype=np.float64) for name in first.channels}
    clock = next(iter(joined)) if first.has_clock else ""
    for run in alike[1:]:
        gap = 0 if clock else _APART
        for name, before in joined.items():
            values = np.asarray(run.channels[name], dtype=np.float64)
            if name == clock:
                values = _after(before, values)
            joined[name] = np.concatenate([before, np.full(gap, np.nan), values])
    whole = Group(first.name, joined, first.units, first.has_clock)
    return [whole if one is first else one for one in groups if one is first or one not in alike]


def _in_turn(runs: Sequence[Group]) -> bool:
    """True for runs without clocks, or with stamps of one rate that begin anew or later than the run before ends."""
    if not runs[0].has_clock:
        return True
    clocks = [np.asarray(next(iter(run.channels.values())), dtype=np.float64) for run in runs]
    steps = [float(np.median(np.diff(one))) for one in clocks]
    even = all(abs(step - steps[0]) <= 0.01 * abs(steps[0]) for step in steps)
    return even and all(
        abs(later[0] - clocks[0][0]) < steps[0] or later[0] > before[-1] + _APART * steps[0]
        for before, later in pairwise(clocks)
    )


def _says(group: Group) -> tuple[dict[str, str], bool]:
    """Units of the channels of a group by name, and whether it has a clock."""
    return {name: group.units.get(name, "") for name in group.channels}, group.has_clock


def _is_table(group: Group) -> bool:
    """True for numbers of one length in several channels."""
    values = [np.asarray(one) for one in group.channels.values()]
    numbers = all(one.dtype.kind in "fiub" and one.ndim == 1 and one.size > 1 for one in values)
    if numbers and group.has_clock and not np.isfinite(values[0]).all():
        return False
    return numbers and len(values) >= _FEWEST + group.has_clock and len({len(one) for one in values}) == 1


def _after(before: Any, stamps: Any) -> Any:
    """Stamps (n,) as they are where they follow those before, else moved behind them and a gap."""
    if stamps[0] > before[-1]:
        return stamps
    return stamps - stamps[0] + before[-1] + _APART * float(np.median(np.diff(before)))


def _ended(values: Any, rows: int) -> Any:
    """Numbers (n,) or (n, k) with NaN to the length `rows`; other values as they are."""
    values = np.asarray(values)
    if values.dtype.kind not in "fiub" or len(values) == rows:
        return values
    rest = np.full((rows - len(values), *values.shape[1:]), np.nan)
    return np.concatenate([values.astype(np.float64), rest])


def as_seconds(stamps: Any) -> Any:
    """Dates of NumPy (n,) as seconds since the first one."""
    return (stamps - stamps[:1]).astype("timedelta64[ns]").astype(np.int64) * 1e-9
