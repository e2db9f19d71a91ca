"""Groups of channels, each with a clock of its own, as columns of one length: what files of several rates have."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hil.files.input_file import check_values

CLOCK = "time"  # channel of stamps that have no name in the file


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
    groups = [group for group in groups if len(group.channels) > group.has_clock]
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
