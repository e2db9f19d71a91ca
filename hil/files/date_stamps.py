"""Read stamps that are dates or times of day: 2024-03-01T12:00:00.001Z, 01.03.2024 12:00:00,001, 12:00:00.001."""

import re
from collections.abc import Sequence
from datetime import date
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray

DAY_S, HOUR_S = 86400.0, 3600.0
_TIME = r"(?:(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{1,2}(?:[.,:]\d*)?))?\s*(?P<half>[AaPp][Mm])?)"
_ZONE = r"\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?"
_YEAR = r"(?P<y>\d{4}|\d{2})"
_DATES = (
    r"(?P<y>\d{4})(?P<sep>[-/.]?)(?P<m>\d{1,2})(?P=sep)(?P<d>\d{1,2})",
    rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.{_YEAR}",
    # of two orders the one counts in which all stamps are dates, and follow each other closely
    rf"(?P<m>\d{{1,2}})(?P<sep>[-/])(?P<d>\d{{1,2}})(?P=sep){_YEAR}",
    rf"(?P<d>\d{{1,2}})(?P<sep>[-/])(?P<m>\d{{1,2}})(?P=sep){_YEAR}",
    rf"(?P<name>\d{{1,2}}[-. ]+[^\W\d]{{3,9}}[-., ]+{_YEAR}|[^\W\d]{{3,9}}\.? +\d{{1,2}},? +\d{{4}})",
)
_FORMS = [re.compile(rf"{day}(?:T|[ ,;]\s*){_TIME}{_ZONE}") for day in _DATES] + [
    re.compile(_TIME + _ZONE),
    re.compile(r"(?P<min>\d{1,3}):(?P<s>\d{2}[.,]\d+)"),  # of a stopwatch
]
_WITHIN = 10.0  # usual steps: of the hour by which a clock is set, and of the whole hour at which it is


class Dates(NamedTuple):
    """Seconds (n,) since midnight of the first stamp, NaN where a text is no date; a note, "" without one."""

    seconds: FloatArray
    note: str


def is_date(text: str) -> bool:
    """True for a date with time, or a time of day with seconds."""
    return ":" in text and any(form.fullmatch(text.strip()) for form in _FORMS)


def seconds_of(texts: Sequence[str]) -> FloatArray:
    """Seconds (n,) since midnight of the first stamp; NaN where a text is no date. Times of day run over midnight."""
    return read_dates(texts).seconds


def read_dates(texts: Sequence[str]) -> Dates:
    """Read stamps; a clock that was set by an hour, as at a change of summer time, goes on, and the note says it."""
    first = next((text for text in texts if text.strip()), "")
    forms = [form for form in _FORMS if form.fullmatch(first.strip())]
    if not forms:
        return Dates(np.full(len(texts), np.nan), "")
    found = [_seconds(texts, form) for form in forms]

    def unlikely(seconds: FloatArray) -> tuple[int, float]:
        good = seconds[np.isfinite(seconds)]
        return seconds.size - good.size, float(np.abs(np.diff(good)).sum()) if good.size else 0.0

    return _without_hours(min(found, key=unlikely))


def _seconds(texts: Sequence[str], form: re.Pattern[str]) -> FloatArray:
    days, seconds = np.full(len(texts), np.nan), np.full(len(texts), np.nan)
    ordinals = dict[tuple[str, ...], float]()
    dated = {"y", "name"} & set(form.groupindex)
    for row, text in enumerate(texts):
        match = form.fullmatch(text.strip())
        if match is None:
            continue
        part = match.groupdict()
        key = tuple(part.get(one) or "" for one in ("name", "y", "m", "d"))
        if key not in ordinals:  # of months by name each next one is the next day
            ordinals[key] = _ordinal(*key[1:]) if not key[0] else float(len(ordinals))
        days[row] = ordinals[key] if dated else 0.0
        hour, half = int(part.get("h") or 0), (part.get("half") or "").lower()
        hour = hour % 12 + 12 * (half == "pm") if half else hour
        # 12:00:00:123 is a form of some loggers for milliseconds
        second = float(re.sub("[,:]", ".", part["s"] or "0"))
        seconds[row] = HOUR_S * hour + 60.0 * int(part["min"]) + second
    if not dated:
        back = np.diff(seconds, prepend=seconds[:1]) < -0.5 * DAY_S
        days += np.cumsum(back)
    good = days[np.isfinite(days)]
    return np.asarray(DAY_S * (days - (good[0] if good.size else 0.0)) + seconds)


def _without_hours(seconds: FloatArray) -> Dates:
    """Take out steps of an hour, forwards or back, to or from a whole hour."""
    good = np.flatnonzero(np.isfinite(seconds))
    steps = np.diff(seconds[good])
    if not steps.size:
        return Dates(seconds, "")
    usual = float(np.median(np.abs(steps)))
    near = max(_WITHIN * usual, 1e-3)
    beside = np.minimum(seconds[good][1:] % HOUR_S, -seconds[good][:-1] % HOUR_S)
    jumps = np.flatnonzero((np.abs(np.abs(steps) - HOUR_S) <= near) & (beside <= near))
    if not jumps.size or near > 0.1 * HOUR_S:
        return Dates(seconds, "")
    shift = np.zeros(seconds.size)
    for jump in jumps:
        shift[good[jump + 1] :] -= HOUR_S * np.sign(steps[jump])
    row = int(good[jumps[0] + 1]) + 1
    note = f"clock: the stamps step by an hour at row {row} of the numbers (summer time); the hour is left out"
    return Dates(seconds + shift, note)


def _ordinal(year: str, month: str, day: str) -> float:
    try:
        return float(date(int(year) + 2000 * (len(year) == 2), int(month), int(day)).toordinal())
    except ValueError:
        return float("nan")
