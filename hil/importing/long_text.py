"""Read a text with one value of one variable in each line between blanks, as monitors of variables write it:

AX1:Motor.PosAct   2024-03-01 12:00:00.001000   1.234      the name first, as EPICS camonitor
0.001  torque  0.52 Nm                                     the stamp first
"""

import re
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from hil.files.input_file import lines_of
from hil.importing.map_file import SeriesColumns
from hil.importing.units import unit_named

_SAMPLE = 200  # lines that tell the form
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_STAMP = rf"(?P<stamp>\d{{4}}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(?:\.\d+)?|{_NUMBER})"
_NAME = r"(?P<name>[A-Za-z_/$][^\s,;]*)"
_VALUE = rf"(?P<value>{_NUMBER})(?: +(?P<word>[^\d\s]\S*)(?: +[^\d\s].*)?)?"  # and a unit or an alarm; no second number
_FORMS = tuple(re.compile(" +".join(parts)) for parts in ((_NAME, _STAMP, _VALUE), (_STAMP, _NAME, _VALUE)))
_FEWEST = 3  # lines of a name: with fewer the second field is a text of its row
_NEARLY_ALL = 0.9  # share of lines: the others are messages
MONITORED = SeriesColumns(time="time", names=("name",), value="value")


class MonitoredValues(NamedTuple):
    """Texts of the columns of `MONITORED` (n,), and lines (n,) from 1."""

    fields: dict[str, list[str]]
    lines: list[int]


def long_form(path: Path) -> re.Pattern[str] | None:
    """The form of the lines of a text of this kind; None for another one."""
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line for line in islice(lines_of(path, file), _SAMPLE) if line.strip()]
    for form in _FORMS:
        found = [match["name"] for line in lines if (match := form.fullmatch(line.strip()))]
        if len(found) > _NEARLY_ALL * len(lines) and 2 <= len(set(found)) <= len(found) / _FEWEST:
            return form
    return None


def read_long(path: Path, form: re.Pattern[str]) -> MonitoredValues:
    """The values of a text in this form; other lines are left out."""
    read = MonitoredValues({name: [] for name in MONITORED.columns}, [])
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(lines_of(path, file), 1):
            match = form.fullmatch(line.strip())
            if match is not None:
                unit = f" {match['word']}" if match["word"] and unit_named(match["word"]) else ""
                for name, text in zip(read.fields, (match["stamp"], match["name"], match["value"] + unit), strict=True):
                    read.fields[name].append(text)
                read.lines.append(number)
    return read
