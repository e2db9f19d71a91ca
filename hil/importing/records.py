"""Read a file of records as columns: JSON, XML, a text of monitored variables; with one value each, put together."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hil.files.date_stamps import is_date
from hil.files.input_file import parsing
from hil.files.json_columns import RecordColumns, read_json
from hil.files.xml_records import xml_columns
from hil.importing.cell_units import number_part, read_cells
from hil.importing.long_text import MONITORED, long_form, read_long
from hil.importing.map_file import SeriesColumns
from hil.importing.number_form import NumberForm, find_form
from hil.importing.series import series_rows
from hil.importing.series_columns import find_series
from hil.importing.text_rows import Cell

RECORD_ENDINGS = (".json", ".jsonl", ".ndjson", ".xml")
_SAMPLE = 400  # records that tell the form, from the beginning, and as many from all
_MOSTLY = 0.5  # share of texts that are no numbers, from which a column is one of words


@dataclass(frozen=True)
class Records:
    """Columns of a file, and the units, unreadable texts and notes of those that were put together of single values."""

    columns: RecordColumns
    cell_units: dict[str, str] = field(default_factory=dict)
    texts: dict[str, Cell] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_records(path: Path) -> Records:
    """Read `path` by its ending. Raises InputError: damaged, too large, or no lists in it."""
    ending = path.suffix.lower()
    if ending not in RECORD_ENDINGS:
        with parsing(path, "text with a value per line"):
            form = long_form(path)
            assert form is not None, "its form has changed"
            read = read_long(path, form)
        empty = RecordColumns({}, {}, {})
        return _put_together(path, read.fields, MONITORED, empty, read.lines.__getitem__, NumberForm())
    if ending == ".xml":
        with parsing(path, "XML file of records"):
            content = RecordColumns((found := xml_columns(path))[0], {}, found[1])
    else:
        content = read_json(path)
    lists = content.lists
    rows = len(next(iter(lists.values()), []))
    if rows == 0 or any(len(one) != rows for one in lists.values()):
        return Records(content, notes=tuple(content.notes))
    places = (*range(min(rows, _SAMPLE)), *range(0, rows, max(1, rows // _SAMPLE)))
    marks = _form([[number_part(one[row]) for one in lists.values() if isinstance(one[row], str)] for row in places])
    of = find_series(tuple(lists), [[_text(one[row]) for one in lists.values()] for row in places], marks)
    if of is None:
        return _of_texts(content, marks)
    fields = {name: [_text(value) for value in lists[name]] for name in of.columns}
    return _put_together(path, fields, of, content, lambda row: row + 1, marks)


def _form(rows: Sequence[Sequence[str]]) -> NumberForm:
    """Form of the numbers among the texts of records; numbers that are no texts have a decimal point."""
    found = [[text for text in row if text and not is_date(text)] for row in rows]
    return find_form([row for row in found if row])[0] if any(found) else NumberForm()


def _put_together(
    path: Path,
    fields: Mapping[str, Sequence[str]],
    of: SeriesColumns,
    content: RecordColumns,
    number: Callable[[int], int],
    form: NumberForm,
) -> Records:
    """Columns of the channels; `number` is that of a line or record (from 1)."""
    found = series_rows(path, fields, lambda row: f"{path}:{number(row)}", of, form)
    lists = {of.time: found.stamps.tolist()} | {name: values.tolist() for name, values in found.columns.items()}
    units = content.units | found.told | ({of.time: "s"} if found.dates else {})
    texts = {name: Cell(number(row), text) for name, (row, text) in found.texts.items()}
    notes = (*content.notes, *found.notes)
    return Records(RecordColumns(lists, content.scalars, units, content.texts), found.units, texts, notes)


def _of_texts(content: RecordColumns, form: NumberForm) -> Records:
    """Columns whose numbers are texts, perhaps with units, as numbers."""
    lists, units, texts = dict(content.lists), dict[str, str](), dict[str, Cell]()
    for name, values in content.lists.items():
        given = [value for value in values if value is not None]
        if not given or not all(isinstance(value, str) for value in given) or is_date(given[0]):
            continue
        cells = read_cells([_text(value) for value in values], form)
        if len(cells.texts) < _MOSTLY * len(given):
            lists[name] = cells.values.tolist()
            units |= {name: cells.unit} if cells.unit else {}
            if cells.texts:
                row = min(cells.texts)
                texts[name] = Cell(row + 1, cells.texts[row])
    columns = RecordColumns(lists, content.scalars, content.units, content.texts)
    return Records(columns, units, texts, tuple(content.notes))


def _text(value: object) -> str:
    return "" if value is None else str(value)
