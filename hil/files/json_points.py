"""Objects per channel of a JSON file whose values have stamps of their own, as rows of one value each.

{"meta": {"name": "x", "EGU": "mm"}, "data": [{"secs": 1, "nanos": 5, "val": 0.1}, ...]}   EPICS archiver appliance
{"target": "x", "datapoints": [[0.1, 1709042400000], ...]}                                  pairs in either order
{"name": "x", "timestamps": [0, 10], "values": [0.1, 0.2]}                                  two lists
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from hil.files.date_stamps import is_date

NAME_KEYS = ("name", "channel", "id", "target", "pv", "tag", "signal", "variable", "__name__")
VALUE_KEYS = ("values", "data", "samples", "datapoints", "points")
STAMP_KEYS = (("secs", "sec"), ("nsecs", "nanosec", "nsec", "nanos"))
UNIT_KEYS = ("unit", "units", "EGU", "egu")
_TIME_KEYS = ("time", "timestamp", "ts", "t", "date", "stamp", "millis", "x")
_TIMES_KEYS = ("timestamps", "times", "time", "t", "stamps")
_POINT_KEYS = ("value", "val", "v", "y")
_QUALITY_KEYS = ("quality", "q", "severity", "status")
_SAMPLE = 400  # pairs that tell which one is the stamp


class _Channel(NamedTuple):
    name: str
    unit: str
    points: Sequence[Any]


def first_of(row: Mapping[str, Any], keys: Sequence[str], *kinds: type) -> Any:
    """The first value under one of `keys` that is of a kind; None without one."""
    return next((row[key] for key in keys if isinstance(row.get(key), kinds)), None)


def stamp_of(row: Mapping[str, Any]) -> str | None:
    """Seconds of an object of seconds and nanoseconds, with all digits; None of another one."""
    second, nano = (first_of(row, keys, int) for keys in STAMP_KEYS)
    return None if second is None or nano is None else f"{second}.{nano:09d}"


def rows_of_points(data: object) -> dict[str, list[Any]] | None:
    """Columns name, unit, time, value and quality of the values of all channels; None of other data."""
    channels = _channels(data)
    if not channels:
        return None
    turned = _stamp_is_last([one.points for one in channels])
    rows = dict[str, list[Any]](name=[], unit=[], time=[], value=[], quality=[])
    for one in channels:
        for point in one.points:
            stamp, value, quality = _read(point, turned)
            for key, field in zip(rows, (one.name, one.unit, stamp, value, quality), strict=True):
                rows[key].append(field)
    return {key: values for key, values in rows.items() if key in ("name", "time", "value") or any(values)}


def _channels(data: object) -> list[_Channel]:
    if isinstance(data, dict) and len(data) > 1:  # channels by name
        data = [{"name": name, **(one if isinstance(one, dict) else {"data": one})} for name, one in data.items()]
    if not isinstance(data, list) or not data or not all(isinstance(one, dict) for one in data):
        return []
    found = []
    for one in data:
        flat = {
            **one,
            **{key: inner for value in one.values() if isinstance(value, dict) for key, inner in value.items()},
        }
        name, points = first_of(flat, NAME_KEYS, str), first_of(flat, VALUE_KEYS, list)
        times = first_of(flat, _TIMES_KEYS, list)
        if points and times is not None and len(times) == len(points):
            points = list(zip(times, points, strict=True))
        if name is None or not points or not all(map(_is_point, points)):
            return []
        found.append(_Channel(name, first_of(flat, UNIT_KEYS, str) or "", points))
    return found


def _is_point(point: Any) -> bool:
    """True for a value with a stamp."""
    if isinstance(point, dict):
        stamp = stamp_of(point) or first_of(point, _TIME_KEYS, int, float, str)
        return stamp is not None and any(key in point for key in _POINT_KEYS)
    return (
        isinstance(point, list | tuple) and len(point) == 2 and not any(isinstance(one, list | dict) for one in point)
    )


def _stamp_is_last(channels: Sequence[Sequence[Any]]) -> bool:
    """True if the second of each pair is its stamp: a date, or a number that grows in all channels."""
    sample = [[point for point in points[:_SAMPLE] if not isinstance(point, dict)] for points in channels]

    def grows(place: int) -> bool:
        columns = [[point[place] for point in points] for points in sample]
        if all(isinstance(one, str) and is_date(one) for column in columns for one in column):
            return True
        numbers = all(isinstance(one, int | float) for column in columns for one in column)
        return numbers and all(column == sorted(column) for column in columns)

    return not grows(0) and grows(1)


def _read(point: Any, turned: bool) -> tuple[Any, Any, Any]:
    """Stamp, value and quality of a point."""
    if not isinstance(point, dict):
        return (point[1], point[0], None) if turned else (*point, None)
    stamp = stamp_of(point) or first_of(point, _TIME_KEYS, int, float, str)
    value = next((point[key] for key in _POINT_KEYS if key in point), None)
    return stamp, value, first_of(point, _QUALITY_KEYS, int, str)
