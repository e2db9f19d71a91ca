"""Read a text with one value of one variable in each line, as monitors of variables write it:

AX1:Motor.PosAct   2024-03-01 12:00:00.001000   1.234      the name first, as EPICS camonitor
0.001;torque;0.52                                          the stamp first
"""

import re
from itertools import islice
from pathlib import Path

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.files.date_stamps import seconds_of
from hil.files.input_file import check_values, lines_of

_SAMPLE = 200  # lines that tell the form
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_STAMP = rf"(?P<stamp>\d{{4}}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(?:\.\d+)?|{_NUMBER})"
_NAME, _BETWEEN = r"(?P<name>[A-Za-z_/$][^\s,;]*)", r"[\s,;]+"
_VALUE = rf"(?P<value>{_NUMBER})(?:{_BETWEEN}[^\d\s].*)?"  # and a unit or an alarm; no second number
_FORMS = tuple(re.compile(_BETWEEN.join(parts)) for parts in ((_NAME, _STAMP, _VALUE), (_STAMP, _NAME, _VALUE)))
_FEWEST = 3  # lines of a name: with fewer the second field is a text of its row
_NEARLY_ALL = 0.9  # share of lines: the others are messages
_SLOW = 3.0  # intervals of the fastest variable: one that is older holds its value


def long_form(path: Path) -> re.Pattern[str] | None:
    """The form of the lines of a text of this kind; None for another one."""
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = [line for line in islice(lines_of(path, file), _SAMPLE) if line.strip()]
    for form in _FORMS:
        found = [match["name"] for line in lines if (match := form.fullmatch(line.strip()))]
        if len(found) > _NEARLY_ALL * len(lines) and 2 <= len(set(found)) <= len(found) / _FEWEST:
            return form
    return None


def read_long(path: Path, form: re.Pattern[str]) -> dict[str, FloatArray]:
    """The variables by name at the times of the one with most values, while all such have values; `time` [s].

    Between two values of a variable it is interpolated, as of a motion; after a longer time it has held its value.
    """
    stamps: dict[str, list[str]] = {}
    values: dict[str, list[float]] = {}
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in lines_of(path, file):
            match = form.fullmatch(line.strip())
            if match is not None:
                stamps.setdefault(match["name"], []).append(match["stamp"])
                values.setdefault(match["name"], []).append(float(match["value"]))
    most = max(values, key=lambda name: len(values[name]))
    check_values(path, len(values) * len(values[most]), f"{len(values)} variables of up to {len(values[most])} values")
    times, arrays = dict[str, FloatArray](), dict[str, FloatArray]()
    for name, own_s in zip(stamps, _seconds(list(stamps.values())), strict=True):  # monitors may print them late
        order = np.argsort(own_s, kind="stable")[: np.isfinite(own_s).sum()]
        times[name], arrays[name] = own_s[order], np.array(values[name])[order]
    times = {name: own_s for name, own_s in times.items() if own_s.size}
    longest_s = _SLOW * float(np.median(np.diff(times[most])))
    fast = [own_s for own_s in times.values() if own_s.size > 1 and np.median(np.diff(own_s)) <= longest_s]
    if not fast:
        raise InputError(f"{path}: no variable has two different stamps; give a text with the channels of a motion")
    first_s, last_s = max(own_s[0] for own_s in fast), min(own_s[-1] for own_s in fast)
    time_s = times[most][(times[most] >= first_s) & (times[most] <= last_s)]
    return {"time": time_s} | {name: _at(time_s, own_s, arrays[name], longest_s) for name, own_s in times.items()}


def _seconds(stamps: list[list[str]]) -> list[FloatArray]:
    """Seconds of the stamps of each variable, since one midnight if they are dates."""
    every = [stamp for own in stamps for stamp in own]
    dated = seconds_of(every)
    seconds = np.array(every, dtype=np.float64) if np.isnan(dated).all() else dated
    return np.split(seconds, np.cumsum([len(own) for own in stamps])[:-1])


def _at(time_s: FloatArray, own_s: FloatArray, own: FloatArray, longest_s: float) -> FloatArray:
    before = np.clip(np.searchsorted(own_s, time_s, side="right") - 1, 0, None)
    after = np.clip(before + 1, None, own_s.size - 1)
    slow = own_s[after] - own_s[before] > longest_s
    return np.where(slow, own[before], np.interp(time_s, own_s, own))
