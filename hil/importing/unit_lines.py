"""What lines above the numbers say of the columns: a list of units, or the name of a column with words and its unit."""

import re
from collections.abc import Sequence

from hil.importing.column_names import label
from hil.importing.lexicon import Quantity, RowKind, lexicon
from hil.importing.listed_scales import fields_of, rest_of_channel, scale_field
from hil.importing.units import QUANTITY_OF_UNIT, factor_and_unit, unit_named

_COMMENT = re.compile(r"^[\s\"#%/;!]+")
_SEPARATORS = (r"[;,|\t]", r"\s/\s", r"\s+")
_BRACKET = re.compile(r"[\[({](.*?)[\])}]")


def told_units(lines: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Units by column `names` of the first of the `lines` that is a list of units.

    A list as long as the columns, or as those without the time, is in their order. Of another one a unit is that of the
    columns of its quantity, if the list has one of this quantity.
    """
    for line in lines:
        units = _list_of_units(line)
        if not units or set(units) <= set(names):  # s, v, a may be names
            continue
        timeless = [name for name in names if label(name).quantity is not Quantity.TIME]
        if len(units) == len(names):
            return dict(zip(names, units, strict=True))
        if len(units) == len(timeless):
            return dict(zip(timeless, units, strict=True))
        of = {QUANTITY_OF_UNIT.get(unit_named(unit) or ""): unit for unit in units}
        read = {name: label(name) for name in names}
        told = {name: of[one.quantity] for name, one in read.items() if one.unit is None and one.quantity in of}
        return {name: unit for name, unit in told.items() if read[name].electric in (None, unit_named(unit))}
    return {}


def _list_of_units(line: str) -> list[str]:
    """Units of a line that holds nothing else: "# units: s, mm, %"; at least two of them, each of a quantity once."""
    text = _COMMENT.sub("", line).strip(' "\r\n')
    word, colon, rest = text.partition(":")
    text = rest if colon and re.fullmatch(lexicon().rows[RowKind.UNITS], word.strip().lower()) else text
    for separator in _SEPARATORS:
        units = [field.strip(' []()"') for field in re.split(separator, text.strip())]
        if len(units) > 1 and all(unit_named(unit) or unit in ("", "-") for unit in units) and any(units):
            return units
    return []


def described(lines: Sequence[str], names: Sequence[str], of_units: bool = False) -> dict[str, tuple[str, str]]:
    """Words and unit of columns that a line names in turn: "ch2 set [um] | ch3 motor [inc]", "xs set mm, M Nm".

    One alone counts if the line is known to be `of_units`.
    """
    for line in lines:
        found = {name: re.search(rf"(?<!\w){re.escape(name)}(?!\w)", line) for name in names if name}
        places = sorted((match.start(), match.end(), name) for name, match in found.items() if match)
        ends = [*(start for start, _, _ in places), len(line)][1:]
        told = {name: _words_and_unit(line[begin:end]) for (_, begin, name), end in zip(places, ends, strict=False)}
        if len(told) > (0 if of_units else 1) and sum(bool(unit) for _, unit in told.values()) > len(told) / 2:
            return told
    each = {name: one for name in names if name for line in lines if (one := _of_one(line, name, names))}
    return each if len(each) > 1 else {}


def _of_one(line: str, name: str, names: Sequence[str]) -> tuple[str, str] | None:
    """Words and unit of a line that begins with a column's name, or ends with it and a unit.

    "CH1: motor speed (0.1 rpm)", "CH2,Torque,5V,N m"; "COL 3  POS.ACT  mm"; "Channel 1","PosAct","mm","1".
    """
    last = re.search(
        rf"(?<![\w.]){re.escape(name)}\"?[\s:=;,|]+(?:[\[({{]([^\])}}]+)[\])}}]|([^\s;,|\])}}]+)[\])}}]?)\s*$", line
    )
    told = (last[1] or last[2]) if last else ""
    if unit_named(told) and told not in names:  # else it is a header, of t, n and m
        return "", told
    part = factor_and_unit(told) if last and last[1] and re.match(rf"[\W\d_]*{re.escape(name)}", line) else None
    if part and part[0] < 1.0:  # 0 cnt [1/4 us]; more is a range
        return "", told
    rest = rest_of_channel(line, name)
    if rest is None:
        return None
    bracket = _BRACKET.search(rest)
    if bracket and (unit_named(bracket[1]) or factor_and_unit(bracket[1])):
        return rest[: bracket.start()].strip(), bracket[1]
    word = re.compile(lexicon().rows[RowKind.UNITS])
    fields = [one for one in fields_of(rest) if not word.fullmatch(one.lower().replace("_", " "))]
    units = {place: unit for place, field in enumerate(fields) if place and (unit := _unit_of_field(field))}
    if not units and fields and unit_named(fields[0]) and fields[0] not in names:
        return "", fields[0]
    if not units:
        return None
    plain = [place for place, unit in units.items() if unit_named(unit)]
    place = max(plain or units)
    return next((one for one in fields[:place] if label(one).sure), fields[0]), units[place]


def _unit_of_field(field: str) -> str:
    """Unit that is a field, perhaps with a factor below 1 (more is a range), or stands behind one; "" without it.

    0.1 rpm, LSB=0.01 mm
    """
    told = scale_field(field)
    unit = told.unit if told else field
    part = factor_and_unit(unit)
    return unit if unit_named(unit) or (part and part[0] < 1.0) else ""


def _words_and_unit(text: str) -> tuple[str, str]:
    bracket = _BRACKET.search(text)
    if bracket and (unit := next((one for one in _starts(bracket[1]) if unit_named(one)), "")):
        return text[: bracket.start()].strip(), unit
    words = re.split(r"[,;|(]", text)[0].split()
    last = words[-1] if words and unit_named(words[-1]) and not re.search(r"[\d=]", text) else ""
    return " ".join(words[: len(words) - bool(last)]), last


def _starts(text: str) -> list[str]:
    """A text, the part before a comma, and its first word: inc 65536/rev."""
    return [text, text.split(",")[0], *text.split()[:1]]
