"""Read stamps that are dates or times of day: 2024-03-01T12:00:00.001Z, 01.03.2024 12:00:00,001, 12:00:00.001."""

import re
from collections.abc import Sequence
from datetime import date

import numpy as np

from hil.arrays import FloatArray

DAY_S = 86400.0
_TIME = r"(?:(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{1,2}(?:[.,:]\d*)?))?\s*(?P<half>[AaPp][Mm])?)"
_ZONE = r"\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?"
_DATES = (
    r"(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})",
    r"(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<y>\d{4})",
    r"(?P<m>\d{1,2})/(?P<d>\d{1,2})/(?P<y>\d{4})",  # a recording over midnight is read as American
)
_FORMS = [re.compile(rf"{day}[T ,;]\s*{_TIME}{_ZONE}") for day in _DATES] + [re.compile(_TIME + _ZONE)]


def is_date(text: str) -> bool:
    """True for a date with time, or a time of day with seconds."""
    return any(form.fullmatch(text.strip()) for form in _FORMS)


def seconds_of(texts: Sequence[str]) -> FloatArray:
    """Seconds (n,) since midnight of the first stamp; NaN where a text is no date. Times of day run over midnight."""
    days, seconds = np.full(len(texts), np.nan), np.full(len(texts), np.nan)
    form = next((form for form in _FORMS if texts and form.fullmatch(texts[0].strip())), None)
    if form is None:
        return seconds
    ordinals = dict[tuple[str, str, str], float]()
    for row, text in enumerate(texts):
        match = form.fullmatch(text.strip())
        if match is None:
            continue
        part = match.groupdict()
        if "y" in part:
            key = part["y"], part["m"], part["d"]
            if key not in ordinals:
                ordinals[key] = _ordinal(*key)
            days[row] = ordinals[key]
        else:
            days[row] = 0.0
        hour = int(part["h"]) % 12 + 12 * (part["half"].lower() == "pm") if part["half"] else int(part["h"])
        # 12:00:00:123 is a form of some loggers for milliseconds
        second = float(re.sub("[,:]", ".", part["s"] or "0"))
        seconds[row] = 3600.0 * hour + 60.0 * int(part["min"]) + second
    if "y" not in form.groupindex:
        back = np.diff(seconds, prepend=seconds[:1]) < -0.5 * DAY_S
        days += np.cumsum(back)
    return np.asarray(DAY_S * (days - days[0]) + seconds)


def _ordinal(year: str, month: str, day: str) -> float:
    try:
        return float(date(int(year), int(month), int(day)).toordinal())
    except ValueError:
        return float("nan")
