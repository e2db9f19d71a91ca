"""Constants that a file gives beside its columns: in lines above the numbers, or as scalars with a name.

A line is "words [: = ; ,] number [unit]", as loggers and drives write it; a scalar has its unit in its name. The words
are those of `lexicon.yaml`, compared without accents.
"""

import re
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hil.importing.lexicon import Constant, ConstantWords, lexicon


@dataclass(frozen=True)
class HeaderValue:
    """Value in the SI unit of its constant, and the text that gives it."""

    value: float
    text: str


_LINE = re.compile(r"^(?P<name>\D*?)[\s:=;,|\t]*(?P<number>[+-]?\d[\d.,]*(e[+-]?\d+)?)(?P<rest>.*)$")
_BRACKET = re.compile(r"[\[({](.*?)[\])}][\s:=;,|]*$")
_SIGNS = re.compile(r"[\s·*.]+")  # between the parts of a unit
_TEXT_OF_NAME = re.compile(r"[^a-z0-9/:]+")


def header_values(lines: Iterable[str], scalars: Mapping[str, float]) -> dict[Constant, HeaderValue]:
    """Constants of header `lines` and `scalars`. One that is given twice with different values is left out."""
    texts = [text for line in lines for text in dict.fromkeys([line, *re.split(r"[;,|]\s", line)])]
    given = [(*reading, text) for text in texts if (match := _split(text)) for reading in _readings(match)]
    for name, scalar in scalars.items():
        words, unit = _unit_of_name(name)
        given.append((words, scalar, [unit], f"{name} = {scalar:g}"))
    found: dict[Constant, list[HeaderValue]] = {}
    for words, number, units, text in given:
        one = next((known for unit in units if (known := _constant(words, number, unit))), None)
        if one is not None:
            found.setdefault(one[0], []).append(HeaderValue(one[1], text.strip().strip('"#%/; ')))
    return {one: values[0] for one, values in found.items() if len({value.value for value in values}) == 1}


def _split(line: str) -> re.Match[str] | None:
    match = _LINE.match(_folded(line.strip().strip('"#%/ ')))
    return match if match and re.search("[a-z]", match["name"]) else None


def _readings(match: re.Match[str]) -> list[tuple[str, float | None, list[str]]]:
    """Words of a line, its number, and the texts that may be its unit.

    They are in brackets after the words, or after the number: all up to a bracket or a comma, or its first words; or
    the words end with it: cycle_time_us.
    """
    value, bracket = _number(match["number"]), _BRACKET.search(match["name"])
    each = [field.strip() for field in re.split(r"[\t;|]", match["rest"])[1:]]
    if any(_number(field) not in (None, value) for field in each if re.fullmatch(r"[\d.,]+", field)):
        return []  # another value for each channel
    if bracket:
        return [(_plain(match["name"][: bracket.start()]), value, [_SIGNS.sub("", bracket[1])])]
    repeated = set(re.split(r"[\s;,|]+", match["rest"].strip(" \t;,|"))) == {match["number"]}  # for each channel
    words = [] if repeated else re.split(r"[\])};,]", match["rest"].strip(' \t;,[("'))[0].split()
    behind = [_SIGNS.sub("", "".join(words[:take])) for take in (None, 3, 2, 1)]
    name, unit = _unit_of_name(match["name"])
    return [(name, value, [unit])] if unit and not words else [(_plain(match["name"]), value, behind)]


def _constant(name: str, value: float | None, unit: str) -> tuple[Constant, float] | None:
    if value is None or value <= 0.0:
        return None
    for constant, known in lexicon().constants.items():
        if unit in known.units and re.fullmatch(_pattern(known), name):
            si = value * known.units[unit]
            return (Constant.RATE, 1.0 / si) if constant is Constant.PERIOD else (constant, si)
    return None


def _pattern(known: ConstantWords) -> str:
    words = f"({known.words})"
    return f"(.* )?{words}( ({'|'.join(lexicon().joints)}))?" if known.ends_a_text else words


def _unit_of_name(name: str) -> tuple[str, str]:
    """Words and unit of the name of a scalar: torque_constant_nm_a -> torque_constant, nma."""
    tokens = _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)).split()
    units = {unit for known in lexicon().constants.values() for unit in known.units if unit}
    for take in (4, 3, 2, 1):
        unit = "".join(tokens[-take:])
        if len(tokens) > take and unit in units:
            return " ".join(tokens[:-take]), unit
    return " ".join(tokens), ""


def _folded(text: str) -> str:
    """Lower case without accents."""
    plain = text.replace("ß", "ss").replace("µ", "u").replace("μ", "u")
    return unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode().lower()


def _plain(name: str) -> str:
    return " ".join(_TEXT_OF_NAME.sub(" ", _folded(name)).split())


def _number(text: str) -> float | None:
    text = text.rstrip(".,")
    try:
        return float(text.replace(",", ".") if "." not in text else text.replace(",", ""))
    except ValueError:
        return None
