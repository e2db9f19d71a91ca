"""Read columns of numbers from a JSON file, in the forms that tools write:

{"t": [0, 1], "x": [0.1, 0.2], "rate": 1000}         lists by name, scalars beside them
{"signals": {"t": [...]}, "units": {"t": "s"}}       the same one level deeper, with units
[{"t": 0, "x": 0.1}, {"t": 1, "x": 0.2}]             a record per row
[{"stamp": {"secs": 1, "nsecs": 5}, "name": ["a"], "position": [0.1]}, ...]     a message per row, as of ROS
{"columns": ["t", "x"], "data": [[0, 0.1], ...]}     a table
[{"name": "x", "unit": "mm", "values": [...]}, ...]  an object per channel
{"x": {"unit": "mm", "data": [...]}, ...}            the same by name
[{"meta": {"name": "x", "EGU": "mm"}, "data": [{"secs": 1, "nanos": 5, "val": 0.1}, ...]}, ...]
{"x": [[0, 0.1], ...], "y": [[0, 1], ...]}           values with stamps of each channel (`json_points`)
[["t", "x"], [0, 0.1], [1, 0.2]]                     a matrix, with a row of names or without
{"t": 0, "x": 0.1}                                   one such record in each line

A record in the stream that is no row, as a greeting or a heartbeat, is a source of scalars.
"""

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.input_file import MOST_BYTES, check_file, check_values, parsing
from hil.files.json_points import NAME_KEYS, UNIT_KEYS, VALUE_KEYS, first_of, rows_of_points, stamp_of

_SELDOM = 0.05  # share of the records: a value that fewer have is no channel
MOST_JSON_BYTES = MOST_BYTES // 10  # three characters may become an object of 72 bytes


@dataclass(frozen=True)
class RecordColumns:
    """Lists of values, scalars, units and texts of a file of records, by name; scalars and texts by path: motor.kt.

    `notes` tell what was left out.
    """

    lists: dict[str, list[Any]]
    scalars: dict[str, float]
    units: dict[str, str]
    texts: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def numbers(self, path: Path, name: str) -> FloatArray:
        """The list `name` as numbers (n,), null as NaN. Raises InputError: no such list, or no numbers."""
        if name not in self.lists:
            raise InputError(f"{path}: column {name!r} is missing; the file has {listed(self.lists)}")
        for row, value in enumerate(self.lists[name]):
            if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
                raise InputError(
                    f"{path}: row {row + 1}: {name}: given {value!r}, allowed a finite number; correct the value"
                )
        with parsing(path, f"column {name}", "correct its numbers"):  # whole numbers of any length
            return np.array([np.nan if value is None else value for value in self.lists[name]], dtype=np.float64)


def read_json(path: Path) -> RecordColumns:
    """Read `path`. Raises InputError: no JSON, or no lists in it."""
    check_file(path, "a JSON file up to this size, or the recording as CSV or Parquet", MOST_JSON_BYTES)
    with parsing(path, "JSON file"):
        data = _loaded(path, path.read_text(encoding="utf-8-sig"))
    content = RecordColumns({}, {}, {})
    with parsing(path, "JSON file of numbers"):
        _collect(path, data, content)
    if not content.lists:
        raise InputError(
            f"{path}: holds no list of numbers, allowed lists by name or a record per row; export the channels as lists"
        )
    return content


def _loaded(path: Path, text: str) -> Any:
    """The content: one value, or one in each line."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
        if not error.msg.startswith("Extra data") or len(lines) < 2:
            raise
    rows = []
    for number, line in lines:
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError as error:
            raise InputError(
                f"{path}:{number}: column {error.colno} is no JSON ({error.msg}): given {line.strip()[:60]!r}, allowed "
                "a record per line; the line is cut or damaged: import the part of the file before it"
            ) from None
    return rows


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Values of a record by path: fields of objects as KEY.FIELD, elements of lists as KEY.NAME or KEY.0, KEY.1, ...

    NAME are the texts of a list `name` of the same length. An object of seconds and nanoseconds is one stamp [s].
    """
    names: list[Any] = next((row[key] for key in NAME_KEYS if isinstance(row.get(key), list)), [])
    flat: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, dict):
            stamp = stamp_of(value)
            if stamp is None:
                flat |= {f"{key}.{field}": inner for field, inner in _flat(value).items()}
            else:
                flat[key] = float(stamp)
        elif isinstance(value, list) and value is not names:
            named = len(names) == len(value)
            flat |= {f"{key}.{names[index] if named else index}": one for index, one in enumerate(value)}
        elif value is not names:
            flat[key] = value
    return flat


def _rows(records: list[dict[str, Any]]) -> tuple[list[bool], list[int]]:
    """Which records are rows, and which are the only ones of their kind, as a greeting.

    No row is one with a value that few records have, and half or less of the values that all usual kinds have, but for
    texts.
    """
    few = _SELDOM * len(records)
    times = Counter(key for one in records for key in one)
    kinds = Counter(frozenset(one) for one in records)
    usual = [kind for kind, number in kinds.items() if number > few]
    texts = {key for one in records[-1:] for key, value in one.items() if isinstance(value, str)}
    shared = frozenset.intersection(*usual) - texts if usual else frozenset[str]()
    is_row = [
        2 * len(shared & one.keys()) > len(shared) or all(times[key] > few for key in one) or not shared
        for one in records
    ]
    once = [at for at, one in enumerate(records) if not is_row[at] and kinds[frozenset(one)] == 1]
    return is_row, once


def _with_channels(data: dict[str, Any], into: RecordColumns, within: str) -> dict[str, Any]:
    """The data without its objects of one list each, which are channels by name if they are as long as each other."""
    found = {name: (own, one) for name, one in data.items() if isinstance(one, dict) and (own := _only_list(one))}
    if len(found) < 2 or len({len(own) for own, _ in found.values()}) > 1:
        return data
    for name, (own, one) in found.items():
        into.lists[name] = own
        into.units.update({name: unit} if (unit := first_of(one, UNIT_KEYS, str)) else {})
        more = {f"{within}{name}.{key}": value for key, value in one.items()}
        into.scalars.update({key: float(value) for key, value in more.items() if _is_number(value)})
        into.texts.update({key: value for key, value in more.items() if isinstance(value, str)})
    return {name: one for name, one in data.items() if name not in found}


def _only_list(data: dict[str, Any]) -> list[Any] | None:
    """The values of an object whose only list or object they are; None of another one."""
    values: list[Any] | None = first_of(data, VALUE_KEYS, list)
    inner = [value for value in data.values() if isinstance(value, list | dict)]
    return values if values and len(inner) == 1 and not isinstance(values[0], list | dict) else None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _collect(path: Path, data: Any, into: RecordColumns, within: str = "") -> None:
    """Put what `data` holds into `into`; `within` is the path to it, with a point at its end."""
    lists, units = into.lists, into.units
    if (points := rows_of_points(data)) is not None:
        lists.update(points)
    elif isinstance(data, list) and data and all(isinstance(row, dict) for row in data):
        channels = [(first_of(row, NAME_KEYS, str), first_of(row, VALUE_KEYS, list), row.get("unit")) for row in data]
        if all(name is not None and values is not None for name, values, _ in channels):  # an object per channel
            lists.update({name: values for name, values, _ in channels})
            units.update({name: unit for name, _, unit in channels if isinstance(unit, str)})
        else:  # a record per row
            every = [_flat(row) for row in data]
            is_row, once = _rows(every)
            flat = [one for one, row in zip(every, is_row, strict=True) if row]
            for one in once:
                _collect(path, data[one], into, within)
            if len(flat) < len(every):
                into.notes.append(f"{len(every) - len(flat)} records are no rows and left out, such as a greeting")
            keys = dict.fromkeys(key for row in flat for key in row)
            check_values(path, len(keys) * len(flat), f"{len(flat)} records with {len(keys)} keys")
            for key in keys:
                lists[key] = [row.get(key) for row in flat]
    elif isinstance(data, list) and len(data) > 1 and all(isinstance(row, list) for row in data):  # a matrix
        named = all(isinstance(name, str) for name in data[0])
        names = data[0] if named else [f"column {number + 1}" for number in range(len(data[0]))]
        for index, name in enumerate(names):
            lists[name] = [row[index] if index < len(row) else None for row in data[named:]]
    elif isinstance(data, dict):
        data = _with_channels(data, into, within)
        names, rows = data.get("columns"), data.get("data", data.get("rows"))
        if isinstance(names, list) and isinstance(rows, list) and all(isinstance(row, list) for row in rows):
            for index, name in enumerate(names):
                lists[str(name)] = [row[index] if index < len(row) else None for row in rows]
            data = {key: value for key, value in data.items() if key not in ("columns", "data", "rows")}
        for name, value in data.items():
            if isinstance(value, list) and value and not isinstance(value[0], dict | list):
                lists[name] = value
            elif _is_number(value):
                into.scalars[f"{within}{name}"] = float(value)
            elif isinstance(value, str):
                into.texts[f"{within}{name}"] = value
            elif isinstance(value, dict | list):
                if isinstance(value, dict) and all(isinstance(unit, str) for unit in value.values()):
                    units.update(value)
                _collect(path, value, into, f"{within}{name}.")
