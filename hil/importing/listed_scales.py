"""Factors and offsets of channels in lines above the numbers, a line for each: CH1;Position;mm;scale 0.001."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from math import isfinite

import numpy as np

from hil.arrays import FloatArray
from hil.importing.lexicon import RowKind, lexicon
from hil.importing.units import unit_named

_BETWEEN = re.compile(r"[;\t|]|,(?!\d)|(?<!\d),")  # a comma between two digits is the decimal mark
_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[-+]?\d+)?"
_VALUE = re.compile(
    rf"(?P<number>{_NUMBER})(?:\s*[/:]\s*(?P<by>\d+)|(?:\^|\*\*)(?P<power>-?\d+))?"
    r"\s*(?P<unit>(?:1/)?[^\d\s/:.,].*)?",
    re.IGNORECASE,
)
_MOST_BITS = 64  # power of two
_PER_COUNT = re.compile(r"\s*/\s*(lsb|counts?|cts?|digits?|inc|bit)$", re.IGNORECASE)
_PER_VOLT = re.compile(r"\s*/\s*V$")
_FRACTION = re.compile(rf"(?!\d+$){_NUMBER}", re.IGNORECASE)


@dataclass(frozen=True)
class ScaleField:
    """A field that tells a factor or an offset (`kind`): LSB=0.01 mm. `value` is None where it is not read."""

    kind: RowKind
    value: float | None
    unit: str = ""


@dataclass
class ListedScales:
    """Factor and offset by name of a channel, and notes on fields that look like one and are not read."""

    scales: dict[str, tuple[float, float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def rest_of_channel(line: str, name: str) -> str | None:
    """Text of a line behind the `name` of a channel with which it begins, perhaps after a word such as "Channel 1";
    None if it begins otherwise. A name with a digit is no word of a sentence: a blank may follow it."""
    behind = r"(?:\s*[:=;,\t|]\s*|\s+)" if re.fullmatch(r"[^\W\d]+\d+", name) else r"\s*[:=;,\t|]\s*"
    match = re.match(
        rf"[\s\"#%/;!]*(?:(?:{'|'.join(lexicon().enumerated)})\s*\d*\"?\s*[:=;,\t|]\s*\"?)?"
        rf"{re.escape(name)}\"?{behind}(.*)$",
        line,
        re.IGNORECASE,
    )
    return match[1] if match else None


def fields_of(text: str) -> list[str]:
    """Fields between semicolons, bars, tabs or commas that are no decimal mark."""
    return [one.strip(' "') for one in _BETWEEN.split(text)]


def scale_field(text: str) -> ScaleField | None:
    """Read a field: scale 0.001, factor=-1e-3, x0.1, Faktor 1/1000, offset 2; None for one that tells neither."""
    match = _word().match(text)
    if match is None or not re.search(r"\d", text):
        return None
    kind = RowKind.OFFSET if match["offset"] else RowKind.SCALE
    value, unit = value_and_unit(text[match.end() :]) or (None, "")
    return ScaleField(kind, value if value or kind is RowKind.OFFSET else None, unit)


def value_and_unit(text: str) -> tuple[float, str] | None:
    """Number and unit of a text: 1e-3, 1/1000 mm, =360/65536 deg, 2^-20 rev, 200 mm/V, 0.5 um/LSB; None: another."""
    told = _VALUE.fullmatch(text.strip(" =:()"))
    if told is None:
        return None
    unit = _PER_COUNT.sub("", told["unit"] or "")
    if unit and unit_named(_PER_VOLT.sub("", unit)) is None:
        return None
    value = float(told["number"].replace(",", "."))
    if told["power"]:
        value = value ** int(told["power"]) if value in (2.0, 10.0) and abs(int(told["power"])) <= _MOST_BITS else 0.0
    if told["by"]:
        value = value / float(told["by"]) if float(told["by"]) else 0.0
    return (value, unit) if isfinite(value) else None


def listed_scales(lines: Sequence[str], names: Sequence[str]) -> ListedScales:
    """Scales of the channels `names` by the lines that begin with them; a factor of 0 is not read."""
    found = ListedScales()
    for name in names:
        rest = next((rest for line in lines if (rest := rest_of_channel(line, name))), "")
        factor, offset = 1.0, 0.0
        for text in fields_of(rest)[1:]:
            told = scale_field(text)
            if told is None and not _FRACTION.fullmatch(text):
                continue
            if told is None or told.value is None:
                found.notes.append(
                    f"header: {text!r} of {name} is not read; give it as scale or offset of this channel in the map if "
                    "it is one"
                )
            elif told.kind is RowKind.SCALE:
                factor = told.value
            else:
                offset = told.value
        if (factor, offset) != (1.0, 0.0):
            found.scales[name] = factor, offset
    return found


def is_raw(values: FloatArray, factor: float, offset: float) -> bool:
    """True if a factor of the header is still to be applied to a column (n,): to whole numbers, as a drive has them."""
    given, whole = values[np.isfinite(values)], is_whole(values)
    multiples = factor > 1.0 and bool(np.all(given % factor == 0.0)) and bool(given.any())
    return (factor == 1.0 and offset != 0.0) or (factor != 1.0 and whole and not multiples)


def is_whole(values: FloatArray) -> bool:
    """True for a column (n,) of whole numbers."""
    given = values[np.isfinite(values)]
    return bool(np.all(given == np.round(given)))


@cache
def _word() -> re.Pattern[str]:
    """Beginning of a field that tells a factor or an offset, up to its number."""
    rows = lexicon().rows
    words = rf"(?:(?P<offset>{rows[RowKind.OFFSET]})|{rows[RowKind.SCALE]})\b[\s:=(]*[x×*]?"
    return re.compile(rf"\s*(?:{words}|[x×*](?=\s*[-+.,\d]))\s*", re.IGNORECASE)
