"""Hints of a user about a file: sampling rate, axis, and a README or data sheet with sizes and units."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hil.files.input_file import check_file
from hil.importing.column_names import label
from hil.importing.encodings import encoding_of
from hil.importing.foreign_table import ForeignTable
from hil.importing.header_values import HeaderValue, header_values
from hil.importing.lexicon import Constant, Quantity
from hil.importing.listed_scales import is_raw, is_whole
from hil.importing.readme_columns import WHOLES, ToldColumn, told_columns
from hil.importing.unit_lines import described
from hil.importing.units import QUANTITY_OF_UNIT, unit_named
from hil.importing.wheel_told import travel_told

# Counts of an encoder, 2^21; not within a sum or a product.
_POWER = re.compile(r"(?<![\w.,*/^+-])2 ?(?:\^|\*\*) ?(\d{1,2})(?![\w.,]?\d|\s*[-+*/]\s*\d)")
# Blanks between thousands: 3 600 000 inc per table revolution, 22 000 Nm/rad.
_BLANKS = re.compile(
    r"(?<![\w.,])(?<!\d )(?<!no\. )(?<!axis )(?<!encoder )(?<!run )(?<!leg )(?<!columns: )"
    r"[1-9]\d{0,2}(?:[ \u00a0\u2009\u202f]\d{3})+"
    r"(?=\s+(?:inc|ink|counts?\b|cnts?\b|pulses|impuls|steps|lines|cts\b|nm/rad))",
    re.IGNORECASE,
)
_NO_ENCODER = re.compile(r"\b(?:error|deviation|accuracy|ripple|fehler|abweichung|x ?4|quadratur\w*)\b", re.IGNORECASE)
_LOAD = "table|output|load|plate|joint|tisch(?:es)?|abtriebs?|last|gelenks?"
_PER_LOAD_TURN = re.compile(  # 3600000 inc per table revolution
    r"(?<![\w.,])(\d+)\s+(\w+)(?: ?/ ?| (?:per|pro|je|par) )"
    rf"(?:(?:{_LOAD})[ -]?(?:turn|rev|umdr|tour)"
    rf"|(?:turn|rev\w*|umdr\w*|tour) (?:of|des|der|de) (?:the )?(?:{_LOAD})\b)",
    re.IGNORECASE,
)
_LONGEST = 1_000_000  # bytes: no README is as long


class FileHints(NamedTuple):
    """Sampling rate of a file without time stamps, axis of a file with several, README of the machine."""

    rate_hz: float | None = None
    axis: str | None = None
    readme: Path | None = None

    @classmethod
    def of(cls, options: Mapping[str, str]) -> "FileHints":
        """The hints in options of the command line, by name."""
        rate, readme = options.get("--rate"), options.get("--readme")
        return cls(float(rate) if rate else None, options.get("--axis"), Path(readme) if readme else None)

    @property
    def options(self) -> list[str]:
        """The hints as options of the command line."""
        rate = f"{self.rate_hz:g}" if self.rate_hz else None
        told = (("--rate", rate), ("--axis", self.axis), ("--readme", self.readme))
        return [text for name, value in told if value for text in (name, str(value))]


NO_HINTS = FileHints()


def with_readme(table: ForeignTable, readme: Path) -> ForeignTable:
    """Add the constants, and the units and words of columns, that a README tells; what the file says goes first.

    Raises InputError: no such file, or one of more than 1 MB.
    """
    check_file(readme, "a text of the owner", _LONGEST)
    raw = readme.read_bytes().splitlines()
    encoding = encoding_of(raw)
    lines = [_plain_numbers(line.decode(encoding)) for line in raw]
    titles = {table.titles.get(name, name): name for name in table.columns}
    listed = {title: ToldColumn(*one) for title, one in described(lines, list(titles)).items()}
    told = {titles[title]: one for title, one in (told_columns(lines, list(titles)) | listed).items()}
    told = _of_load(table, lines) | _by_number(lines, list(table.columns)) | told
    several = _by_placeholder(titles)
    of_several = told_columns(lines, list(several)) if several else {}
    told = {name: one for alias, one in of_several.items() for name in several[alias]} | told
    if parts := _last_parts(titles):
        told = {parts[part]: one for part, one in told_columns(lines, list(parts)).items()} | told
    told = {name: fits for name, one in told.items() if _fits(table, name, fits := _in_volts(one))}
    constants = header_values(lines, {})
    if lead := travel_told(lines, constants.get(Constant.LEAD)):
        constants[Constant.LEAD] = lead
    if motors := _motor_encoders(told):  # each encoder has its own counts
        of_motor = told[motors[0]]
        constants[Constant.COUNTS] = HeaderValue(float(of_motor.per_turn or 0), f"{motors[0]}: {of_motor.words}")
        told = {name: _as_angle(table, name, one) if name not in motors else one for name, one in told.items()}
    firm = {name: one.unit for name, one in told.items() if one.step and _is_firm(table, name, one)}
    units = {n: unit for n, unit in table.units.items() if n not in firm and (n not in told or unit_named(unit))}
    steps = {name: one.step for name, one in told.items() if one.step and (name in firm or name not in units)}
    return replace(
        table,
        units={name: one.unit for name, one in told.items() if one.unit} | units,
        scales={name: (step, 0.0) for name, step in steps.items()} | table.scales,
        firm_units=firm,
        words={name: one.words for name, one in told.items() if one.words} | table.words,
        constants=constants | table.constants,
    )


def _plain_numbers(line: str) -> str:
    """A line with powers of two, and numbers with blanks between thousands, as plain numbers."""
    line = _POWER.sub(lambda power: str(1 << int(power[1])), line)
    return _BLANKS.sub(lambda number: re.sub(r"\s", "", number[0]), line)


def _of_load(table: ForeignTable, lines: list[str]) -> dict[str, ToldColumn]:
    """The only column of the load's encoder in counts, as an angle, where a line tells its counts per turn."""
    labels = {name: label(table.titles.get(name, name)) for name in table.columns}
    loads = [name for name, one in labels.items() if one.table and not one.command and is_whole(table.columns[name])]
    counted = [name for name in loads if _own_unit(table, name) in (None, "counts")]
    told = [one for line in lines if not _NO_ENCODER.search(line) for one in _PER_LOAD_TURN.finditer(line)]
    found = {float(one[1]) for one in told if unit_named(one[2]) == "counts"}
    if len(counted) != 1 or len(found) != 1 or 0.0 in found:
        return {}
    return {counted[0]: ToldColumn("", "deg", 360.0 / found.pop())}


def _by_number(lines: list[str], columns: list[str]) -> dict[str, ToldColumn]:
    """What a numbered list says of the columns, by their names; empty if it has not all of them."""
    names = {f"column {number}": name for number, name in enumerate(columns, 1)}
    told = told_columns(lines, list(names)) if columns[0] not in names else {}
    return {names[number]: one for number, one in told.items()} if len(told) == len(columns) else {}


def _by_placeholder(titles: Mapping[str, str]) -> dict[str, list[str]]:
    """Columns by a name that a text may give to several: runX_i for runA_i and runB_i."""
    found = dict[str, list[str]]()
    for title, name in titles.items():
        for match in re.finditer(r"(?<=[a-z_])[A-Z\d](?=_|$)|(?<=[a-z])[A-Z](?=[A-Z])", title):
            found.setdefault(f"{title[: match.start()]}X{title[match.end() :]}", []).append(name)
    return {alias: names for alias, names in found.items() if len(names) > 1 and alias not in titles}


def _last_parts(titles: Mapping[str, str]) -> dict[str, str]:
    """Columns by the last part of a title with points, if one has it: enc of log.enc, as its owner calls it."""
    last = [(title.rpartition(".")[2], name) for title, name in titles.items() if "." in title]
    parts = [part for part, _ in last]
    return {
        part: name
        for part, name in last
        if re.match(r"[^\W\d]", part) and parts.count(part) == 1 and part not in titles
    }


def _motor_encoders(told: Mapping[str, ToldColumn]) -> list[str]:
    """The columns of the motor's encoder, one in each part of a file, if counts per turn are told of it."""
    motors = [name for name, one in told.items() if one.per_turn and label(name, "", one.words).motor]
    return motors if len({(told[name].per_turn, told[name].words) for name in motors}) == 1 else []


def _as_angle(table: ForeignTable, name: str, told: ToldColumn) -> ToldColumn:
    """A column of another encoder, with counts per turn of its own, as an angle; a set-point is in those of a drive."""
    title = table.titles.get(name, name)
    unit = unit_named(table.units[name]) if name in table.units else label(title).unit
    counts = unit in (None, "counts") and is_whole(table.columns[name])
    if not (told.per_turn and counts) or label(name, "", told.words).command:
        return told
    return told._replace(unit="deg", step=360.0 / told.per_turn)


def _in_volts(told: ToldColumn) -> ToldColumn:
    """What is told of a voltage, if its scale per volt is another quantity: the speed constant of a motor, 60 rpm/V."""
    said = label("", "", told.words).quantity
    of_unit = QUANTITY_OF_UNIT.get(unit_named(told.unit) or "")
    other = told.of in ("V", "mV") and said not in (Quantity.UNKNOWN, Quantity.OTHER, of_unit)
    return ToldColumn(told.words, told.of) if other else told


def _is_firm(table: ForeignTable, name: str, told: ToldColumn) -> bool:
    """True if the size of a count goes before the unit of the column's name: that is counts, or what is told of it."""
    return bool(told.per_turn or told.of) or _own_unit(table, name) == "counts"


def _own_unit(table: ForeignTable, name: str) -> str | None:
    """Unit that a file gives a column beside it, or in its name."""
    return unit_named(table.units.get(name, "")) or label(table.titles.get(name, name)).unit


def _fits(table: ForeignTable, name: str, told: ToldColumn) -> bool:
    """True if a column may be what a README tells: of the quantity of its words, and whole numbers of its counts."""
    said = label(table.titles.get(name, name), "", told.words).quantity
    of_unit = QUANTITY_OF_UNIT.get(unit_named(told.unit) or "")
    if of_unit is not None and said not in (Quantity.UNKNOWN, Quantity.OTHER, of_unit):
        return False
    if told.step is None:
        return True
    if told.of:
        named = _own_unit(table, name)
        return named == told.of or (named is None and (told.of in WHOLES or not is_whole(table.columns[name])))
    return is_whole(table.columns[name]) if told.step == 1.0 else is_raw(table.columns[name], told.step, 0.0)
