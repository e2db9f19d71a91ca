"""Read the rows of a text file, for the draft of a map and for the import by it alike.

A line without a number is a message, and everything after the last complete row is an end tag or a footer: they are
left out, and said. Any other line that is no row is damaged.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.files.date_stamps import is_date, read_dates
from hil.files.input_file import lines_of
from hil.importing.cell_units import read_cells, tell_units
from hil.importing.map_file import CsvOptions, SeriesColumns
from hil.importing.number_form import NumberForm, numbers_of
from hil.importing.series import series_rows
from hil.importing.text_lines import line_of, of_terminal, open_text, shown, split_line, times_of_groups

_CHUNK = 20_000  # lines that are read at once
_MOSTLY = 0.5  # share of numbers from which text in a column is out of place
_LONGEST = 50  # lines of a footer: more are a column that has no numbers any more
_JOINTS = 20  # most different names in turn


class Cell(NamedTuple):
    """A field that is no number, and its line (from 1)."""

    line: int
    text: str


@dataclass(frozen=True, eq=False)
class TextRows:
    """Columns (n,) of numbers, NaN without one; columns of dates [s]; lines (n,) from 1.

    `texts` is the first text of a column that is no number, `in_turn` the texts of one whose few texts alternate,
    `units` those of columns whose cells hold theirs, `told` those of channels in a unit that is not known.
    """

    numbers: dict[str, FloatArray]
    dates: dict[str, FloatArray]
    texts: dict[str, Cell]
    lines: NDArray[np.int64]
    notes: tuple[str, ...]
    in_turn: dict[str, tuple[str, ...]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    told: dict[str, str] = field(default_factory=dict)


def read_rows(path: Path, names: Sequence[str], options: CsvOptions, most: int | None = None) -> TextRows:
    """Read all columns, or the first `most` rows of them; of one value each all rows, for channels may stand in turn.

    Raises InputError: a damaged row, with its line and text.
    """
    reader = _Reader(path, tuple(names), options)
    with open_text(path, options.encoding) as file:
        lines = enumerate(islice(lines_of(path, file), options.skip_lines, None), options.skip_lines + 1)
        below = (one for one in lines if one[1].strip())
        skip = (options.column_names is None) + options.skip_rows
        rows = islice(below, skip, skip + most if most and not options.series else None)
        while block := list(islice(rows, _CHUNK)):
            reader.take(block)
    return reader.finish()


class _Reader:
    def __init__(self, path: Path, names: tuple[str, ...], options: CsvOptions) -> None:
        self.path, self.names, self.encoding, self.delimiter = path, names, options.encoding, options.delimiter
        self.form = NumberForm(options.decimal_point, options.thousands)
        # time beside each channel or group of channels: those of lower rate end before the others
        self.groups = bool(times_of_groups(names))
        self.only = [(self.names.index(name), text) for name, text in options.only.items() if name in self.names]
        self.rows: list[list[str]] = []
        self.lines: list[int] = []
        self.parts: dict[str, list[FloatArray]] = {name: [] for name in names}
        # of columns of dates and of series, which are read as a whole
        self.series = options.series
        self.fields: dict[str, list[str]] = {name: [] for name in (self.series.columns if self.series else ())}
        self.texts: dict[str, dict[int, str]] = {name: {} for name in names}  # by row
        self.units = dict[str, str | None].fromkeys(names)
        self.units_of: dict[str, str] = {}  # column of the units beside each column
        self.others: list[tuple[int, str, bool]] = []  # lines that are no rows: number, text, damaged
        self.converted = 0

    def take(self, block: Sequence[tuple[int, str]]) -> None:
        """Take numbered lines that are not blank."""
        if not self._take_plain(block):
            for number, line in block:
                self._take_line(number, line, split_line(line, self.delimiter))
            self._convert()

    def _take_plain(self, block: Sequence[tuple[int, str]]) -> bool:
        """Take lines at once, in a fifth of the time, if all of them are rows of finite numbers; else none of them."""
        if self.groups or self.only or self.fields or self.form.thousands or any(self.units.values()):
            return False
        blanks = self.delimiter == " "
        text = "\n".join(" ".join(line.split()) if blanks else line.rstrip("\r\n") for _, line in block)
        kinds = {str(number): pa.float64() for number in range(len(self.names))}
        try:
            table = pacsv.read_csv(
                pa.BufferReader(text.encode()),
                pacsv.ReadOptions(column_names=list(kinds), use_threads=False),
                pacsv.ParseOptions(delimiter=self.delimiter, quote_char=False),
                pacsv.ConvertOptions(column_types=kinds, decimal_point=self.form.decimal, null_values=[]),
            )
        except ValueError:  # pa.ArrowInvalid; a delimiter that is no single byte
            return False
        columns = [column.to_numpy() for column in table.columns]
        if table.num_rows != len(block) or not all(np.isfinite(values).all() for values in columns):
            return False
        for name, values in zip(self.names, columns, strict=True):
            self.parts[name].append(values)
            self.units[name] = ""
        self.lines += [number for number, _ in block]
        self.converted += len(block)
        return True

    def _take_line(self, number: int, line: str, fields: list[str]) -> None:
        """Take a line that is not blank: a row, or another line."""
        width, given = len(self.names), len(fields)
        if any(given > index and fields[index] != text and given == width for index, text in self.only):
            return
        extra = [field for field in fields[width:] if field]
        if given != width and not self._numbers(fields[:width]):
            self.others.append((number, line, False))
        elif given > width and self._numbers(extra):
            self.others.append((number, line, True))
        elif given < width and not self.groups:
            cut = self._stamped(fields) or not any(self._words(field) for field in fields)
            cut = cut and not of_terminal(line)
            self.others.append((number, line, cut))
        else:
            self.rows.append(fields[:width] + [""] * (width - given))
            self.lines.append(number)

    def _numbers(self, fields: Sequence[str]) -> bool:
        values, _ = numbers_of(fields, self.form)
        return bool(np.isfinite(values).any()) or any(is_date(field) for field in fields)

    def _stamped(self, fields: Sequence[str]) -> bool:
        """True for a line of a series that has a stamp where its rows have it."""
        place = self.names.index(self.series.time) if self.series and self.series.time in self.names else len(fields)
        return self._numbers(fields[place : place + 1])

    def _words(self, field: str) -> bool:
        return bool(numbers_of([field], self.form)[1]) and not is_date(field)

    def _convert(self) -> None:
        if not self.rows:
            return
        columns = dict(zip(self.names, zip(*self.rows, strict=True), strict=True))
        if not self.converted and not self.series:
            self.units_of = {
                name: beside
                for name, beside in pairwise(self.names)
                if tell_units(beside, columns[beside], columns[name], self.form)
            }
        for name, column in columns.items():
            if self.series and name not in self.fields:
                continue
            if name in self.fields or (not self.converted and any(is_date(field) for field in column[:3])):
                self.fields.setdefault(name, []).extend(column)
                continue
            cells: Sequence[str] = column
            if name in self.units_of:
                both = zip(column, columns[self.units_of[name]], strict=True)
                cells = [f"{one} {unit}".strip() for one, unit in both]
            values, texts, self.units[name] = read_cells(cells, self.form, self.units[name])
            self.parts[name].append(values)
            self.texts[name] |= {self.converted + row: text for row, text in texts.items()}
        self.converted += len(self.rows)
        self.rows = []

    def finish(self) -> TextRows:
        self._refuse_cut()
        return self._of_series(self.series) if self.series else self._of_rows()

    def _of_series(self, of: SeriesColumns) -> TextRows:
        """Rows of one value each as those of all channels."""
        found = series_rows(self.path, self.fields, lambda row: f"{self.path}:{self.lines[row]}", of, self.form)
        lines = np.array(self.lines, dtype=np.int64)
        others = sorted([number for number, _, _ in self.others] + lines[found.others].tolist())
        stamps = {of.time: found.stamps}
        return TextRows(
            found.columns | ({} if found.dates else stamps),
            stamps if found.dates else {},
            {name: Cell(int(lines[row]), text) for name, (row, text) in found.texts.items()},
            lines[found.rows],
            (*self._notes(others, lines), *found.notes),
            units=found.units,
            told=found.told,
        )

    def _of_rows(self) -> TextRows:
        rows = self.converted
        read = {name: read_dates(fields) for name, fields in self.fields.items()}
        dates = {name: one.seconds for name, one in read.items()}
        for name, values in dates.items():
            found = np.flatnonzero(np.isnan(values))
            self.texts[name] = {int(row): self.fields[name][row] for row in found if self.fields[name][row]}
        numbers = {name: np.concatenate(parts) for name, parts in self.parts.items() if parts}
        usual = [name for name in (*numbers, *dates) if len(self.texts[name]) < _MOSTLY * max(rows, 1)]
        wrong = np.zeros(rows, dtype=np.bool_)
        for name in usual:
            wrong[list(self.texts[name])] = True
        told = np.logical_or.reduce([np.isfinite((numbers | dates)[name]) for name in usual] or [wrong])
        complete = np.flatnonzero(~wrong & told)
        last = int(complete[-1]) if complete.size and rows - complete[-1] <= _LONGEST else rows - 1
        kept = ~(wrong & ~told) & (np.arange(rows) <= last)
        lines = np.array(self.lines, dtype=np.int64)
        end = lines[~kept & (np.arange(rows) > complete[-1])] if complete.size else lines[:0]
        if end.size > _LONGEST:
            raise InputError(
                f"{self.path}:{end[0]}: no number as in the rows before, nor in {end.size - 1} more lines: "
                f"{shown(line_of(self.path, int(end[0]), self.encoding))!r}; another form begins; import what is before"
            )
        texts = {
            name: Cell(int(lines[first]), self.texts[name][first])
            for name in (*numbers, *dates)
            if (first := next((row for row in sorted(self.texts[name]) if kept[row]), None)) is not None
        }
        others = sorted([number for number, _, _ in self.others] + lines[~kept].tolist())
        return TextRows(
            {name: values[kept] for name, values in numbers.items()},
            {name: values[kept] for name, values in dates.items()},
            texts,
            lines[kept],
            (*self._notes(others, lines[kept]), *dict.fromkeys(one.note for one in read.values() if one.note)),
            {name: told for name in numbers if (told := _in_turn(list(self.texts[name].values()), rows))},
            {name: unit for name, unit in self.units.items() if unit},
        )

    def _refuse_cut(self) -> None:
        cut = next(((number, line) for number, line, damaged in self.others if damaged), None)
        if cut is not None:
            fields = len(split_line(cut[1], self.delimiter))
            raise InputError(
                f"{self.path}:{cut[0]}: given {fields} fields, allowed {len(self.names)} as in the other rows: "
                f"{shown(cut[1])!r}; the row is cut or damaged: export the recording again, or import the part before"
            )

    def _notes(self, others: list[int], lines: NDArray[np.int64]) -> tuple[str, ...]:
        if not others:
            return ()
        end = int(lines[-1]) if lines.size else 0
        notes = []
        for numbers, what in (
            ([one for one in others if one < end], "between the rows"),
            ([one for one in others if one > end], "after the last row"),
        ):
            if numbers:
                text = shown(line_of(self.path, numbers[0], self.encoding))
                many = f"lines {numbers[0]} to {numbers[-1]} ({len(numbers)})" if len(numbers) > 1 else ""
                notes.append(f"text {what}: {many or f'line {numbers[0]}'} is no row and left out: {text!r}")
        return tuple(notes)


def _in_turn(texts: list[str], rows: int) -> tuple[str, ...]:
    """Different texts of a column of `rows` if they are few, alternate, and stand in as many rows each; () else."""
    different = tuple(dict.fromkeys(texts))
    if len(texts) < rows or not 1 < len(different) <= _JOINTS:
        return ()
    changes = sum(one != other for one, other in pairwise(texts))
    counts = [texts.count(one) for one in different]
    return different if changes > _MOSTLY * rows and max(counts) < 2 * min(counts) else ()
