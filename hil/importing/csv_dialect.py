"""Find how a text file of columns is written: encoding, delimiter, marks of the numbers, and the rows above them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from typing import NamedTuple

from hil.errors import InputError
from hil.files.date_stamps import is_date
from hil.files.input_file import WIDE, first_bytes, is_text, lines_of
from hil.importing.cell_units import has_unit, number_part
from hil.importing.encodings import encoding_of
from hil.importing.header_rows import COMMENT, Header, read_header
from hil.importing.map_file import CsvOptions
from hil.importing.number_form import NumberForm, find_form, number_of
from hil.importing.series_columns import find_series
from hil.importing.text_lines import split_line

SAMPLE_LINES = 400  # from the beginning, more than any preamble, and as many from the whole file
MOST_LINES = 200_000  # read for the draft: minutes of a recording
_DELIMITERS = (";", "\t", ",", "|", " ")
_LEAST_SHARE = 0.3  # of fields with numbers or dates
_PAIRED = 0.1  # share of the rows that all channels of a file have, if some end before the others
_MOSTLY = 0.5  # share of the rows in which a column of numbers has some
_FOLLOW = 3  # rows of numbers in turn, at which they begin


@dataclass(frozen=True)
class CsvDialect:
    """Options of a map, what stands above the columns, and these lines."""

    options: CsvOptions
    header: Header
    above: tuple[str, ...]


class _Layout(NamedTuple):
    """Delimiter, form of the numbers, and for each column if most rows have numbers or dates, and if with units."""

    delimiter: str
    form: NumberForm
    read: tuple[bool, ...]
    units: tuple[bool, ...] = ()


def find_dialect(path: Path) -> CsvDialect:
    """Find the dialect of `path`. Raises InputError: empty, no text, or no rows of numbers."""
    lines, encoding = _lines(path)
    head = lines[:SAMPLE_LINES]
    spread = lines[:: max(1, len(lines) // SAMPLE_LINES)]
    body = [line for line in (*head[len(head) // 2 :], *spread[len(spread) // 10 :]) if line.strip()]
    body = body or [line for line in head if line.strip()]  # rows above a long blank end
    layout = _layout(path, body)
    delimiter, form, width = layout.delimiter, layout.form, len(layout.read)
    first = _first_row(path, head, layout)
    above = head[:first]
    header = read_header(above, delimiter, width, form, _counts(head[first:], layout))
    if form.thousands:
        header.notes.append(f"numbers: {form.thousands!r} is read as the mark between thousands")
    if header.line is None and delimiter == "," and (split := _split_by_commas(above, width)):
        raise InputError(
            f"{path}:{split}: {above[split - 1].strip()[:60]!r} has {width // 2} fields, the rows {width}: decimal "
            "commas between commas cannot be told apart; export with semicolons, or with points"
        )
    given: dict[str, object] = {"delimiter": delimiter, "decimal_point": form.decimal, "thousands": form.thousands}
    given |= {"encoding": encoding}
    step = max(1, len(lines) // SAMPLE_LINES)
    sample = [split_line(line, delimiter) for line in (*lines[first : first + SAMPLE_LINES], *lines[first::step])]
    given["series"] = find_series(header.names, [row for row in sample if len(row) == width], form)
    if header.line is None or split_line(above[header.line], delimiter) != list(header.names):
        given |= {"skip_lines": first, "column_names": header.names}
    else:
        between = sum(bool(line.strip()) for line in above[header.line + 1 :])
        given |= {"skip_lines": header.line, "skip_rows": between}
    return CsvDialect(CsvOptions.model_validate(given), header, tuple(above))


def _counts(lines: Sequence[str], layout: _Layout) -> bool:
    """True if the first column numbers the rows, from any number on."""
    rows = [split_line(line, layout.delimiter) for line in lines if line.strip()]
    first = [number_of(row[0], layout.form) for row in rows if len(row) == len(layout.read)]
    steps = [after - before for before, after in pairwise(one for one in first if one is not None)]
    return bool(steps) and sum(step == 1.0 for step in steps) > _MOSTLY * len(steps)


def _split_by_commas(above: list[str], width: int) -> int:
    """Line (from 1) of a header with half as many fields as the rows, 0 without one."""
    last = max((index for index, line in enumerate(above) if line.strip()), default=-1)
    return last + 1 if last >= 0 and 2 * len(split_line(above[last], ",")) == width else 0


def _lines(path: Path) -> tuple[list[str], str]:
    start = first_bytes(path)
    if not start.strip():
        raise InputError(f"{path}: the file is empty; give a file with a header and rows of numbers")
    if not is_text(start):
        raise InputError(f"{path}: is not text but binary data; export the recording as CSV, .mat, Parquet or JSON")
    encoding = "utf-16" if start.startswith(WIDE) else _encoding(path)
    try:
        with path.open(encoding="utf-8-sig" if encoding == "utf-8" else encoding) as file:
            return [line.rstrip("\r\n") for line in islice(lines_of(path, file), MOST_LINES)], encoding
    except UnicodeDecodeError:
        raise InputError(f"{path}: is damaged {encoding} text; export the recording again as UTF-8") from None


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        return encoding_of([line.rstrip(b"\r\n") for line in islice(file, MOST_LINES)])


def _layout(path: Path, body: list[str]) -> _Layout:
    best: tuple[float, int] = (0.0, 0)
    found = _Layout("", NumberForm(), ())
    for delimiter in _DELIMITERS:
        rows = [split_line(line, delimiter) for line in body]
        widths = Counter(len(row) for row in rows)
        width = widths.most_common(1)[0][0] if rows else 0
        wide = max((one for one, times in widths.items() if times > _PAIRED * len(rows)), default=width)
        if wide >= width + 2:  # channels of lower rate, with their times, end before the others
            width, rows = wide, [row for row in rows if len(row) == wide]
        if width < 2:
            continue
        whole = [row for row in rows if len(row) == width]
        plain = [["" if is_date(field) else number_part(field) for field in row] for row in whole]
        form, share = find_form(plain)
        share *= len(whole) / len(rows)
        # a blank counts only where nothing else separates
        score = (share - (0.01 if delimiter == " " else 0.0), width)
        if score > best:
            told = ([number_of(field, form) is not None for field in column] for column in zip(*plain, strict=True))
            united = ([has_unit(field) for field in column] for column in zip(*whole, strict=True))
            read, units = (tuple(sum(one) > _MOSTLY * len(one) for one in each) for each in (told, united))
            best, found = score, _Layout(delimiter, form, read, units)
    if best[0] < _LEAST_SHARE:
        raise InputError(
            f"{path}: has no rows of numbers in two columns or more, its lines are such as {body[-1].strip()[:60]!r}; "
            "give a text file with rows of numbers separated by comma, semicolon, tab or blank"
        )
    return found


def _first_row(path: Path, lines: Sequence[str], layout: _Layout) -> int:
    """Index of the first row of numbers, with others below it, none of which is of a kind of its own: zero,0,524288."""
    filled = [(index, line) for index, line in enumerate(lines) if line.strip()]
    split = [(index, split_line(COMMENT.sub("#", line), layout.delimiter)) for index, line in filled]
    kinds = Counter(fields[0] for _, fields in split) if not layout.read[0] else Counter[str]()
    alone = {text for text, times in kinds.items() if text and times == 1 and len(kinds) < len(split) / 2}
    rows = [(index, _is_row(fields, layout) and fields[0] not in alone) for index, fields in split]
    for place, (index, _) in enumerate(rows):
        if all(good for _, good in rows[place : place + _FOLLOW]):
            return index
    raise InputError(f"{path}: has no rows of numbers one below the other; give a file with rows of numbers")


def _is_row(fields: list[str], layout: _Layout) -> bool:
    """True if numbers or dates stand where most rows have them, or nothing."""
    kinds = zip(fields, layout.read, layout.units, strict=False)
    told = [number_part(field) if units else field for field, is_read, units in kinds if is_read]
    given = [is_date(field) or number_of(field, layout.form) is not None for field in told if field]
    return len(fields) >= len(layout.read) - 1 and bool(given) and all(given)
