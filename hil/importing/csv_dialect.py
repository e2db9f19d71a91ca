"""Find how a text file of columns is written: delimiter, decimal point, header, row of units, comments."""

import csv
import re
from collections import Counter
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from hil.errors import InputError
from hil.files.input_file import lines_of
from hil.importing.lexicon import lexicon
from hil.importing.map_file import CsvOptions
from hil.importing.units import unit_named

SAMPLE_LINES = 400  # read to find the format: more than any preamble
_DELIMITERS = (";", "\t", ",", "|", " ")
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?")
_COMMENT = re.compile(r"^\s*(#|%|//)+\s?")
_UNIT = re.compile(r"[\[(]?\s*[a-zA-Zµμ°%‰Ω·/^*\d. _-]{0,14}\s*[\])]?")


@dataclass(frozen=True)
class CsvDialect:
    """Options of a map, names as the map must spell them, units of a unit row, and the lines above the numbers."""

    options: CsvOptions
    names: tuple[str, ...]
    units: tuple[str, ...]
    above: tuple[str, ...]


def find_dialect(path: Path) -> CsvDialect:
    """Find the dialect of `path`. Raises InputError: empty, no text, or no rows of numbers."""
    lines, encoding = _sample(path)
    delimiter, point, width, first = _layout(path, lines)
    above = [index for index in range(first) if lines[index].strip()]
    given: dict[str, object] = {"delimiter": delimiter, "decimal_point": point, "encoding": encoding}
    channels = _second_fields(lines[:first], delimiter, width, lexicon().name_line)
    if channels:  # a column of time beside each channel
        names = tuple(name for index, channel in enumerate(channels, 1) for name in (f"time{index}", channel))
        # lines such as "SampleTime;1;SampleTime;1" are half numbers
        first = next(i for i in range(first, len(lines)) if _starts_with_number(lines[i], delimiter, point))
        given |= {"skip_lines": first, "column_names": names}
        of_channels = _second_fields(lines[:first], delimiter, width, lexicon().unit_line) or [""] * len(channels)
        units = tuple(text for unit in of_channels for text in ("", unit))
        return CsvDialect(CsvOptions.model_validate(given), names, units, tuple(lines[:first]))
    unit_row: tuple[str, ...] = ()
    header = None
    for index in reversed(above[-4:]):
        fields = _fields(_without_word(lines[index]), delimiter)
        if len(fields) not in (width, width - 1) or not any(fields):
            continue
        named = [field for field in fields if field]
        if header is None and not unit_row and index != above[0] and _units(named) and len(above) > 1:
            unit_row = (*fields, *[""] * (width - len(fields)))
            continue
        header = index
        break
    if header is None:
        names = tuple(f"column {index + 1}" for index in range(width))
        given |= {"skip_lines": first, "column_names": names}
    else:
        raw = _fields(_COMMENT.sub("", lines[header]), delimiter, strip=False)
        names = tuple(raw)
        if _COMMENT.match(lines[header]) or len(raw) < width or delimiter == " ":
            names = tuple(name.strip() or f"column {index + 1}" for index, name in enumerate((*raw, "")[:width]))
            given |= {"skip_lines": first, "column_names": names}
        else:
            given |= {"skip_lines": header, "skip_rows": sum(header < index < first for index in above)}
    repeated = [name for name, times in Counter(names).items() if times > 1 and name.strip()]
    if repeated:
        raise InputError(f"{path}: {repeated[0]!r} names two columns of the header, allowed one; rename or remove one")
    return CsvDialect(CsvOptions.model_validate(given), names, unit_row or ("",) * width, tuple(lines[:first]))


def _without_word(line: str) -> str:
    """A line without the mark of a comment and the word for units: "# units: s, mm" -> "s, mm"."""
    word, colon, rest = _COMMENT.sub("", line).partition(":")
    return rest if colon and word.strip().lower() in lexicon().unit_line else _COMMENT.sub("", line)


def _starts_with_number(line: str, delimiter: str, point: str) -> bool:
    fields = _fields(line, delimiter)
    return bool(fields and fields[0] and _is_number(fields[0], point))


def _second_fields(above: list[str], delimiter: str, width: int, words: Collection[str]) -> list[str]:
    """Every second field of the line whose other fields are `words`: "Name;Position;Name;Torque"; empty without one."""
    for line in above:
        fields = _fields(line, delimiter)
        if len(fields) == width > 2 and width % 2 == 0 and {one.lower() for one in fields[::2]} <= set(words):
            return fields[1::2]
    return []


def number_of(text: str, decimal_point: str) -> float | None:
    """Number of a field, NaN where it is empty or stands for a missing number; None for other text."""
    text = text.strip()
    if (_COMMA if decimal_point == "," else _POINT).fullmatch(text):
        return float(text.replace(",", "."))
    return float("nan") if text.lower() in ("", *lexicon().missing) else None


def _sample(path: Path) -> tuple[list[str], str]:
    with path.open("rb") as file:
        start = file.read(4096)
        if not start.strip():
            raise InputError(f"{path}: the file is empty; give a file with a header and rows of numbers")
        if start.startswith((b"\xff\xfe", b"\xfe\xff")):
            encoding = "utf-16"
        elif b"\x00" in start or sum(byte < 9 or 13 < byte < 32 for byte in start) > len(start) // 50:
            raise InputError(f"{path}: is not text but binary data; export the recording as CSV, .mat, Parquet or JSON")
        else:
            encoding = "utf-8"
    for known in (encoding, "cp1252"):
        with suppress(UnicodeDecodeError):
            return _lines(path, known), known
    return _lines(path, "cp850"), "cp850"  # of a console; it has a letter for each byte


def _lines(path: Path, encoding: str) -> list[str]:
    with path.open(encoding="utf-8-sig" if encoding == "utf-8" else encoding) as file:
        return [line.rstrip("\r\n") for line in islice(lines_of(path, file), SAMPLE_LINES)]


def _layout(path: Path, lines: list[str]) -> tuple[str, str, int, int]:
    """Delimiter, decimal point, number of columns, and index of the first line of numbers."""
    best: tuple[float, int, str, str, int] | None = None
    body = [line for line in lines[len(lines) // 2 :] if line.strip()]
    for delimiter in _DELIMITERS:
        rows = [_fields(line, delimiter) for line in body]
        width = Counter(len(row) for row in rows).most_common(1)[0][0] if rows else 0
        if width < 2:
            continue
        fields = [field for row in rows if len(row) == width for field in row]
        for point in (".",) if delimiter == "," else (".", ","):
            share = sum(_is_number(field, point) for field in fields) / sum(len(row) for row in rows)
            # a blank counts only where nothing else separates
            score = (share - (0.01 if delimiter == " " else 0.0), width, delimiter, point, width)
            if best is None or score[:2] > best[:2]:
                best = score
    if best is None or best[0] < 0.3:
        raise InputError(
            f"{path}: has no rows of numbers in two columns or more; give a text file with a header and rows of "
            "numbers separated by comma, semicolon, tab or blank"
        )
    _, _, delimiter, point, width = best
    # an export with quoted decimal commas between commas
    if delimiter == "," and point == "." and _quoted_commas(body):
        point = ","
    for index, line in enumerate(lines):
        fields = _fields(line, delimiter)
        if len(fields) == width and sum(_is_number(field, point) for field in fields if field) >= max(1, width / 2):
            return delimiter, point, width, index
    raise InputError(f"{path}: has no rows of numbers; give a file with a header and rows of numbers")


def _quoted_commas(body: list[str]) -> bool:
    fields = [field for line in body for field in _fields(line, ",")]
    return sum(bool("," in field and _COMMA.fullmatch(field)) for field in fields) > len(fields) / 4


def _fields(line: str, delimiter: str, strip: bool = True) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        fields = next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:
        return []
    return [field.strip() for field in fields] if strip else fields


def _is_number(field: str, point: str) -> bool:
    return number_of(field, point) is not None or field.lower() in lexicon().infinite


def _units(fields: list[str]) -> bool:
    """True for a row of units: short words, of which some are units."""
    return all(_UNIT.fullmatch(field) for field in fields) and sum(
        unit_named(field.strip("[]() ")) is not None or field in ("-", "[-]", "[]") for field in fields
    ) >= max(1, len(fields) / 2)
