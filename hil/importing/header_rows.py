"""Tell what each row above the numbers is by what it contains: names, units, types, scale, offset, description.

What a row says of a column is kept with the column; a row that is not used is said.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite

from hil.files.date_stamps import is_date
from hil.importing.column_names import label, plain_words
from hil.importing.lexicon import Quantity, RowKind, lexicon
from hil.importing.listed_names import NAMELESS, listed_names
from hil.importing.listed_scales import scale_field, value_and_unit
from hil.importing.map_file import SECONDS
from hil.importing.number_form import NumberForm, number_of
from hil.importing.text_lines import shown, split_line, times_of_groups
from hil.importing.units import factor_and_unit, unit_named, unit_of_text

COMMENT = re.compile(r"^\s*(#|%|//)+\s?")
_UNIT = re.compile(r"[\[(]?\s*[a-zA-Zµμ°%‰Ω·/^*\d. _-]{0,14}\s*[\])]?(\s*\(\w*\))?")
_BRACKET = re.compile(r"[\[(](.*?)[\])]")
_WORD = re.compile(r"[^\W\d]")
_NEAR = 4  # lines above the numbers whose text may be that of the columns, where they have none else


@dataclass(frozen=True)
class HeaderRow:
    """A row above the numbers with a field for each column; its line (from 0) and text."""

    line: int
    text: str
    kind: RowKind
    fields: tuple[str, ...]
    whole: bool

    @property
    def first(self) -> str:
        """First field that is not empty."""
        return next(one for one in self.fields if one)

    @property
    def sure(self) -> int:
        """Number of different fields that say a quantity."""
        return len({one for one in self.fields if one and label(one).sure})


@dataclass
class Header:
    """What stands above the columns.

    `names` are different for each column; `titles` the text of the file for a column with another name. `scales` are
    factor and offset with which a column becomes a value in its unit, `row_scales` those of rows of their own, which
    the values may hold already; `periods_s` the periods of its rows. `line` is
    the row that alone gives the names, `unused` are rows (from 0) of which nothing was read here.
    """

    names: tuple[str, ...]
    titles: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    scales: dict[str, tuple[float, float]] = field(default_factory=dict)
    row_scales: dict[str, tuple[float, float]] = field(default_factory=dict)
    periods_s: dict[str, float] = field(default_factory=dict)
    line: int | None = None
    notes: list[str] = field(default_factory=list)
    unused: dict[int, str] = field(default_factory=dict)


def read_header(lines: Sequence[str], delimiter: str, width: int, form: NumberForm, counted: bool = False) -> Header:
    """Read the lines above `width` columns of numbers; `counted`: the first one numbers the rows, perhaps nameless."""
    listed = listed_names(lines, delimiter, width, counted)
    of_list = listed.lines if listed else frozenset[int]()
    read = (
        _row(index, line, delimiter, width, form, counted) for index, line in enumerate(lines) if index not in of_list
    )
    rows = [row for row in read if row is not None]
    # a row that is one field short counts where no other one tells what the columns are
    rows = [row for row in rows if row.whole] if any(row.whole and row.sure for row in rows) else rows
    rows = _without_list(_below_padded(rows))
    texts = [row for row in rows if row.kind in (RowKind.NAMES, RowKind.TEXT)]
    named = _names(texts)
    if named is None:
        # short names may be those of units: s, v, a
        named = next((row for row in rows if row.kind is RowKind.UNITS), None)
        rows = [row for row in rows if row is not named]
    if listed is not None and named is not None and sum(label(one).sure for one in listed.names) > named.sure:
        named = None
    listed = listed if named is None else None
    header = Header(listed.names if listed else _different(named, texts, width))
    if named is not None and named.fields == header.names and named.text == lines[named.line]:
        header.line = named.line
    used = {named.line} if named else set[int]()
    of_scales = _add_scale(header, RowKind.SCALE, listed.scales if listed else {}, form)
    header.titles = _titles(named, texts, header.names)
    for row in rows:
        given = {name: text for name, text in zip(header.names, row.fields, strict=True) if text}
        match row.kind:
            case RowKind.UNITS if not header.units:
                header.units = given
            case RowKind.SCALE | RowKind.OFFSET:
                of_scales |= _add_scale(header, row.kind, given, form)
            case RowKind.PERIOD:
                bracket = _BRACKET.search(row.text)
                unit = SECONDS.get(unit_named(bracket[1]) or "", 0.0) if bracket else 1.0
                told = {name: _number(text, form) or 0.0 for name, text in given.items()}
                header.periods_s = {name: unit * value for name, value in told.items() if unit * value > 0.0}
            case RowKind.TYPES | RowKind.NAMES if row is not named:
                pass
            case RowKind.TEXT if row is not named and not listed:
                header.words = {name: f"{header.words.get(name, '')} {text}".strip() for name, text in given.items()}
            case _ if row is not named:
                header.unused[row.line] = row.text
        used.add(row.line)
    of_volts = {name: unit.removesuffix("/V").strip() for name, unit in of_scales.items() if unit.endswith("/V")}
    header.units = of_scales | header.units | of_volts
    header.units |= {
        name: text for name, text in header.words.items() if name not in header.units and unit_of_text(text) is not None
    }
    if named is None and listed is None:
        near = [index for index in range(len(lines)) if lines[index].strip() and index not in used][-_NEAR:]
        if near and len(split_line(COMMENT.sub("", lines[near[-1]]), delimiter)) > 1:
            header.notes.append(
                f"header: line {near[-1] + 1} does not have the {width} fields of the rows, its names are not used: "
                f"{shown(lines[near[-1]])!r}"
            )
    return header


def _below_padded(rows: list[HeaderRow]) -> list[HeaderRow]:
    """Rows without those at the top that a spreadsheet filled up to the width: facts of the file, over no column."""
    padded = [not any(row.fields[-2:]) for row in rows]
    first = padded.index(False) if False in padded else 0
    return rows[first:]


def _without_list(rows: list[HeaderRow]) -> list[HeaderRow]:
    """Rows without those that each describe a column by its name in another row: CH1;Pos;mm over #;CH1;CH2."""
    for row in rows:
        described = {one.line: one.first for one in rows if one is not row and row.fields.count(one.first) == 1}
        if len(described) > 1 and len(set(described.values())) == len(described):
            return [one for one in rows if one.line not in described]
    return rows


def _row(index: int, line: str, delimiter: str, width: int, form: NumberForm, counted: bool) -> HeaderRow | None:
    text = COMMENT.sub("", line)
    if counted and len(split_line(text, delimiter)) < width == len(split_line(line, delimiter)):
        text = line.replace("#", "", 1)  # over a column that numbers the rows
    word, colon, rest = text.partition(":")
    kind = _kind_of_label(word) if colon and delimiter not in word else None
    fields = split_line(rest if kind else text, delimiter)
    while len(fields) > width and not fields[-1]:
        fields.pop()
    times = times_of_groups(fields) if len(fields) == width else ()
    if times and len({fields[index] for index in times}) == 1 and label(fields[0]).quantity is not Quantity.TIME:
        kind = _kind_of_label(fields[0])  # what the row tells stands over each column of time
        fields = ["" if index in times else value for index, value in enumerate(fields)]
    elif kind is None and abs(len(fields) - width) <= 1 and (kind := _kind_of_label(fields[0])):
        fields = fields[1:] if len(fields) > width else ["", *fields[1:], *[""] * (width - len(fields))]
    elif colon and len(fields) == width + 1 and fields[0] == f"{word}:":
        fields = fields[1:]  # a word of any language before the names
    elif len(fields) == width + 1 and _kind(fields[1:], form) is RowKind.UNITS and unit_of_text(fields[0]) is None:
        kind, fields = RowKind.UNITS, fields[1:]
    elif len(fields) > width:
        fields = _regrouped(text, delimiter, width) or fields[: width + (len(fields) > width + 1)]
    fields = _otherwise_split(fields, delimiter, width)
    given = len(fields)
    if given not in (width, width - 1) or given < 2 or not any(fields):
        return None
    lacking = [""] * (width - given)
    fields = [*lacking, *fields] if counted else [*fields, *lacking]
    return HeaderRow(index, line, kind or _kind(fields, form), tuple(fields), given == width)


def _otherwise_split(fields: list[str], delimiter: str, width: int) -> list[str]:
    """Fields of a line of names whose last field holds others with another delimiter: 12:00:00;names: n [rpm], M."""
    last = re.sub(r"^\s*\w+:\s", "", fields[-1]) if fields else ""
    stamped = 1 < len(fields) < width and is_date(fields[0])
    for other in ",;|\t":
        parts = split_line(last, other) if other != delimiter and stamped else []
        if len(fields) - 1 + len(parts) == width and sum(label(one).sure for one in parts) > len(parts) / 2:
            return ["time" if is_date(one) else one for one in fields[:-1]] + parts
    return fields


def _regrouped(text: str, delimiter: str, width: int) -> list[str]:
    """Fields of a line whose names hold the delimiter: "Torque, actual [Nm]", "t / s   M %"; empty if none fits."""
    mark = re.escape(delimiter)
    blanks = delimiter == " "
    wide = r"\s{2,}" if blanks else rf"{mark}(?!\s)"
    for pattern in (wide, rf"(?<=[\])])\s*{mark}"):
        fields = [one.strip(' "') for one in re.split(pattern, text.strip() if blanks else text)]
        if len(fields) == width:
            return fields
    return []


def _kind_of_label(text: str) -> RowKind | None:
    words = " ".join(plain_words(re.sub(r"[\[(].*", "", text)))
    return next((kind for kind, known in lexicon().rows.items() if re.fullmatch(known, words)), None)


def _kind(fields: Sequence[str], form: NumberForm) -> RowKind:
    named = [one for one in fields if one]
    if all(number_of(one, form) is not None for one in named):
        return RowKind.UNKNOWN
    if all((told := scale_field(one)) and told.value is not None for one in named):
        return RowKind.SCALE
    if all(re.sub(r"\d+$", "", one.lower()) in lexicon().types for one in named):
        return RowKind.TYPES
    factors = [factor_and_unit(one) for one in named]
    if any(found and not found[0] for found in factors):
        return RowKind.UNKNOWN  # values with their units
    units = sum(
        unit_of_text(one) is not None or one in ("-", "[-]", "[]") or found is not None
        for one, found in zip(named, factors, strict=True)
    )
    if all(_UNIT.fullmatch(one) for one in named) and units >= max(1, len(named) / 2):
        return RowKind.UNITS
    return RowKind.TEXT if sum(bool(_WORD.search(one)) for one in named) > len(named) / 2 else RowKind.UNKNOWN


def _names(texts: Sequence[HeaderRow]) -> HeaderRow | None:
    """The row of names: one that says so, else that with most words of quantities, else the last."""
    told = next((row for row in texts if row.kind is RowKind.NAMES), None)
    if told or not texts:
        return told
    best = max(row.sure for row in texts)
    return next(row for row in (texts if best else reversed(texts)) if row.sure == best)


def _titles(named: HeaderRow | None, texts: Sequence[HeaderRow], names: Sequence[str]) -> dict[str, str]:
    """Text of each column whose name is another one: a repeated one, or one of another row."""
    if named is None:
        return {}
    own = zip(names, (_title(named, texts, index) for index in range(len(names))), strict=True)
    return {name: title for name, title in own if title and name != title}


def _title(named: HeaderRow, texts: Sequence[HeaderRow], index: int) -> str:
    """Text over a column: of the row of names if it has letters there, else of another row."""
    fields = [named.fields[index], *(row.fields[index] for row in texts)]
    return next((one for one in fields if _WORD.search(one)), fields[0])


def _different(named: HeaderRow | None, texts: Sequence[HeaderRow], width: int) -> tuple[str, ...]:
    """Names of the columns, different from each other: Time, Time (2)."""
    names: list[str] = []
    times = _untitled_times(named)
    for index in range(width):
        title = _title(named, texts, index) if named and index not in times else ""
        name = title or (f"time{times.index(index) + 1}" if index in times else f"{NAMELESS}{index + 1}")
        again = 1 + sum(one == name or one.rpartition(" (")[0] == name for one in names)
        names.append(name if again == 1 else f"{name} ({again})")
    return tuple(names)


def _untitled_times(named: HeaderRow | None) -> list[int]:
    """Places of the columns of time that a row of names leaves empty, before each channel or group of channels."""
    empty = [index for index, field in enumerate(named.fields) if not field] if named else []
    apart = all(second - first > 1 for first, second in pairwise(empty))
    return empty if named and len(empty) > 1 and empty[0] == 0 and apart and named.fields[-1] else []


def read_factor(header: Header, name: str, told: str = "") -> None:
    """Take the number before a unit as a factor: [0.1 Nm], 1/100 deg; `told` is the unit that another line gives."""
    title = header.titles.get(name, name)
    bracket = _BRACKET.search(title)
    text = (bracket[1] if bracket else "") if label(title).unit else header.units.get(name, told)
    text = text or (bracket[1] if bracket else "")
    if found := factor_and_unit(text):
        factor, offset = header.scales.get(name, (1.0, 0.0))
        header.scales[name] = factor * found[0], offset
        header.units[name] = found[1]


def _number(text: str, form: NumberForm) -> float | None:
    """Number of a header, which another part of the program wrote than the rows: with either decimal mark."""
    return next((one for mark in (form.decimal, ".", ",") if (one := number_of(text, NumberForm(mark)))), None)


def _add_scale(header: Header, kind: RowKind, given: dict[str, str], form: NumberForm) -> dict[str, str]:
    """Add the factors or offsets of a row by column; returns the units that stand behind them."""
    units = dict[str, str]()
    for name, text in given.items():
        told = scale_field(text)
        value, unit = (told.value, told.unit) if told else value_and_unit(text) or (_number(text, form), "")
        if value is None or not isfinite(value):
            header.notes.append(f"header: {text!r} of {name} is not read; give it as scale of this channel in the map")
        else:
            units |= {name: unit} if unit else {}
            if unit.endswith("/V"):  # the values are volts
                header.scales[name] = value, 0.0
                continue
            factor, offset = header.row_scales.get(name, (1.0, 0.0))
            header.row_scales[name] = (value, offset) if kind is RowKind.SCALE else (factor, value)
    return units
