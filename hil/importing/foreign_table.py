"""Read all columns of numbers of a foreign file, without a map. What is no number becomes NaN here."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.date_stamps import is_date, seconds_of
from hil.importing.csv_dialect import MOST_LINES, find_dialect
from hil.importing.foreign_columns import as_measured, check_foreign, format_of, parquet_dates
from hil.importing.header_rows import read_factor
from hil.importing.header_values import HeaderValue, header_text
from hil.importing.lexicon import Constant
from hil.importing.listed_scales import is_raw, listed_scales, value_and_unit
from hil.importing.map_file import SECONDS, CsvOptions
from hil.importing.records import read_records
from hil.importing.row_groups import moving_group
from hil.importing.stated import Stated
from hil.importing.text_lines import shown
from hil.importing.text_rows import Cell, read_rows
from hil.importing.unit_lines import described, told_units
from hil.importing.units import factor_and_unit, unit_named
from hil.importing.variables import load_variables
from hil.recording.arrow_files import is_number, numbers, parquet_schema, read_parquet, stored_unit, stored_values

LEAST_NUMBERS = 0.01  # share of rows with a number: with fewer a column is one of text
MOST_COLUMNS = 1000  # whose names are read, 1 ms each
LEAST_HZ, MOST_HZ = 20.0, 1e5  # of rows whose period has no unit
WIDEST = 64  # columns of a matrix in a .mat file: a wider one is no table of channels


@dataclass(frozen=True, eq=False)
class ForeignTable:
    """Columns of equal length, NaN where a field is no number; units and scalars as the file gives them.

    `constants` are what lines above the numbers, or scalars, give by a name that is known. `dates` are columns of dates
    or times of day, in seconds; `texts` is the first text among the numbers of a column, `words` what lines above say
    of it, `titles` its text in the file where the column has another name. `scales` are factor and offset that the file
    gives for a column, `periods_s` the periods of its rows, `cell_units` the units of columns whose cells hold theirs,
    `firm_units` those that go before the unit of a name.
    `notes` tell the user what was left out or assumed; `lines` (n,) are the line numbers of the rows in the file.
    """

    path: Path
    columns: dict[str, FloatArray]
    units: dict[str, str]
    scalars: dict[str, float] = field(default_factory=dict)
    csv: CsvOptions = field(default_factory=CsvOptions)
    constants: dict[Constant, HeaderValue] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    dates: frozenset[str] = frozenset()
    texts: dict[str, Cell] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)
    scales: dict[str, tuple[float, float]] = field(default_factory=dict)
    periods_s: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    lines: NDArray[np.int64] | None = None
    cell_units: dict[str, str] = field(default_factory=dict)
    firm_units: dict[str, str] = field(default_factory=dict)

    def place(self, row: int) -> str:
        """Place of a row (from 0) of the numbers in the file."""
        return f"{self.path}: row {row + 1} of the numbers" if self.lines is None else f"{self.path}:{self.lines[row]}"


def read_table(path: Path) -> ForeignTable:
    """Read `path`. Raises InputError: no such file, empty, damaged, binary, another format, no columns of numbers."""
    check_foreign(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; give a file with rows of numbers")
    readers = {".csv": _text, ".mat": _mat, ".parquet": _parquet, ".json": _records}
    read = readers[format_of(path)](path)
    if "" in read.columns:
        read = replace(read, remarks=(*read.remarks, "(column without a name): give it one to use it"))
    table = _equal_length(replace(read, columns={name: as_measured(one) for name, one in read.columns.items() if name}))
    rows = max((values.size for values in table.columns.values()), default=0)
    if len(read.columns) > MOST_COLUMNS:
        raise InputError(
            f"{path}: given {len(read.columns)} columns of numbers, allowed {MOST_COLUMNS}; export the channels of one "
            "axis, or import them by a map"
        )
    if len(table.columns) < 2 or rows < 3:
        raise InputError(
            f"{path}: given {len(table.columns)} columns of numbers with {rows} rows, allowed two columns and three "
            "rows or more; give a file with the channels of a motion"
        )
    return table


def _text(path: Path) -> ForeignTable:
    dialect = find_dialect(path)
    header = dialect.header
    options, rows = dialect.options, read_rows(path, header.names, dialect.options, MOST_LINES)
    if group := moving_group(path, header.names, options, rows, MOST_LINES):
        options, rows = group.options, group.rows
        header.notes.append(group.note)
    columns, remarks = dict[str, FloatArray](), []
    read = rows.numbers | rows.dates
    names = tuple(read) if options.series else header.names
    for name, values in ((name, read[name]) for name in names):
        if np.isfinite(values).mean() > LEAST_NUMBERS:
            columns[name] = values
        elif name in rows.texts:
            remarks.append(f"{name}: text such as {rows.texts[name].text!r}, no numbers")
    titles = {name: header.titles.get(name, name) for name in names}
    told = described(dialect.above, list(titles.values()))
    of_lines = {title: unit for title, (_, unit) in told.items()}
    if not header.units:
        of_lines |= told_units(dialect.above, list(titles.values()))
    listed = listed_scales(dialect.above, list(told))
    of_list = {name: listed.scales[title] for name, title in titles.items() if title in listed.scales}
    header.row_scales = of_list | header.row_scales
    header.notes += listed.notes
    applied = [name for name, scale in header.row_scales.items() if not is_raw(read[name], *scale)]
    header.scales |= {name: scale for name, scale in header.row_scales.items() if name not in applied}
    header.notes += [
        f"{name}: its values hold the factor {header.row_scales[name][0]:g} of the header already"
        for name in applied
        if header.row_scales[name][0] != 1.0
    ]
    for name, title in titles.items():
        read_factor(header, name, of_lines.get(title, ""))
    units = {name: of_lines[title] for name, title in titles.items() if title in of_lines} | header.units | rows.told
    words = {name: told[title][0] for name, title in titles.items() if title in told} | header.words
    constants = _counted_period(dialect.above, rows.lines.size) | Stated().constants(dialect.above, columns, units)
    read_lines = {
        line
        for line in header.unused
        if any(one.text == header_text(dialect.above[line]) for one in constants.values())
    }
    header.notes += [
        f"header: line {line + 1} is not used: {shown(text)!r}"
        for line, text in header.unused.items()
        if line not in read_lines
    ]
    return ForeignTable(
        path,
        columns,
        units,
        csv=options,
        constants=constants,
        remarks=tuple(remarks),
        dates=frozenset(rows.dates),
        texts={name: cell for name, cell in rows.texts.items() if name in columns},
        words=words,
        titles=header.titles,
        scales=header.scales,
        periods_s=header.periods_s,
        notes=(*header.notes, *rows.notes),
        lines=rows.lines,
        cell_units=rows.units,
    )


def _counted_period(lines: Sequence[str], rows: int) -> dict[Constant, HeaderValue]:
    """Rate by a line of two numbers above the rows: how many follow, and their period in the only unit that fits."""
    for line in lines:
        match = re.fullmatch(r"\s*(\d+)\s*[,;\t ]\s*([\d.]+)\s*", line)
        if match and int(match[1]) == rows and float(match[2]) > 0.0:
            rates = {unit: 1.0 / (SECONDS[unit] * float(match[2])) for unit in ("s", "ms", "us")}
            fitting = {unit: rate for unit, rate in rates.items() if LEAST_HZ <= rate <= MOST_HZ}
            if len(fitting) == 1:
                ((unit, rate),) = fitting.items()
                return {Constant.RATE: HeaderValue(rate, f"{line.strip()}: rows, and {unit} from row to row")}
    return {}


def _mat(path: Path) -> ForeignTable:
    columns, others, stated, told = dict[str, FloatArray](), [], Stated(), dict[str, tuple[float, str]]()
    arrays, units = load_variables(path)
    for name, variable in arrays.items():
        values = np.asarray(variable)
        if (text := _text_in(values)) is not None:
            stated.texts[name] = text
            pairs = values.tolist() if values.dtype.kind == "O" and values.shape[1:] == (2,) else []
            cells = [[_text_in(np.asarray(cell)) or "" for cell in pair] for pair in pairs]
            told |= {
                key: found for key, cell in cells if (found := value_and_unit(cell.partition("(")[0])) and found[1]
            }
        elif values.dtype.kind not in "fiub":
            others.append(name)
        elif values.size == 1:
            stated.numbers[name] = float(values.reshape(-1)[0])
        elif values.size == max(values.shape):
            columns[name] = values.reshape(-1)
        elif values.ndim == 2 and values.shape[1] <= WIDEST and values.shape[0] > values.shape[1]:
            columns |= {f"{name}[{index}]": values[:, index] for index in range(values.shape[1])}
        else:
            others.append(name)
    remarks = [f"{name}: neither a number, a vector nor a matrix with a column per channel" for name in others]
    if not columns:
        raise InputError(
            f"{path}: holds no vector of numbers (there are {listed(others) or 'no variables'}), allowed a vector "
            "per channel or a matrix with a column per channel; save the vectors themselves, not a structure"
        )
    units |= {name: unit for name, (_, unit) in told.items() if name in columns and not units.get(name)}
    scales = {name: (value, 0.0) for name, (value, unit) in told.items() if units.get(name) == unit}
    return _with_stated(ForeignTable(path, columns, units, scales=scales, remarks=tuple(remarks)), stated)


def _text_in(values: NDArray[Any]) -> str | None:
    """Text of a character array or of cells of texts, its rows with semicolons between; None for other values."""
    if values.dtype.kind == "O" and values.ndim:  # without a dimension: an object that is no array
        rows = [_text_in(np.asarray(one)) for one in values.reshape(-1)]
        return None if None in rows or not rows else "; ".join(row for row in rows if row)
    if values.dtype.kind != "U" or not values.size:
        return None
    return "; ".join(str(one).strip() for one in values.reshape(-1))


def _with_stated(table: ForeignTable, stated: Stated) -> ForeignTable:
    """The table with the units, as 0.001 deg, and constants that its file states; a unit of a column counts first."""
    units, scales = stated.units_of(table.columns) | table.units, dict(table.scales)
    for name, (factor, unit) in {name: found for name in units if (found := factor_and_unit(units[name]))}.items():
        if factor and unit_named(unit) != "V":  # 10 V is a range
            units[name], scales[name] = unit, (factor, 0.0)
    columns = table.columns | {name: scales[name][0] * one for name, one in table.columns.items() if name in scales}
    constants = stated.constants((), columns, units)
    return replace(table, units=units, scales=scales, scalars=stated.numbers, constants=constants)


def _parquet(path: Path) -> ForeignTable:
    schema = parquet_schema(path)
    wanted = [one.name for one in schema if is_number(one.type) or pa.types.is_timestamp(one.type)]
    stored_columns = read_parquet(path, wanted)
    columns, units, remarks = {}, {}, []
    dates = set[str]()
    for one in schema:
        if is_number(one.type):
            columns[one.name] = numbers(path, stored_columns, one.name)
            unit = stored_unit(schema, one.name)
            if unit:
                units[one.name] = unit
        elif pa.types.is_timestamp(one.type):
            columns[one.name] = parquet_dates(path, one.name)
            dates.add(one.name)
        else:
            remarks.append(f"{one.name}: {one.type} values, no numbers; convert the column to use it")
    stored = stored_values(schema)
    texts = {name: value for name, value in stored.items() if isinstance(value, str)}
    stated = Stated({name: value for name, value in stored.items() if not isinstance(value, str)}, texts)
    table = ForeignTable(path, columns, units, remarks=tuple(remarks), dates=frozenset(dates))
    return _with_stated(table, stated)


def _records(path: Path) -> ForeignTable:
    records = read_records(path)
    content = records.columns
    columns, remarks = {}, []
    dates = set[str]()
    for name, values in content.lists.items():
        if all(value is None or (isinstance(value, int | float) and not isinstance(value, bool)) for value in values):
            columns[name] = content.numbers(path, name)
        elif all(isinstance(value, str) for value in values) and is_date(values[0]):
            columns[name] = seconds_of(values)
            dates.add(name)
        else:
            other = next(value for value in values if isinstance(value, str | bool | list | dict))
            remarks.append(f"{name}: values such as {other!r}, no numbers")
    table = ForeignTable(
        path,
        columns,
        content.units,
        remarks=tuple(remarks),
        dates=frozenset(dates),
        texts=records.texts,
        notes=records.notes,
        cell_units=records.cell_units,
    )
    return _with_stated(table, Stated(content.scalars, content.texts))


def _equal_length(table: ForeignTable) -> ForeignTable:
    """Keep the columns of the length that most have."""
    if len({values.size for values in table.columns.values()}) < 2:
        return table
    lengths = Counter(values.size for values in table.columns.values() if values.size > 2)
    rows = max(lengths, key=lambda size: (lengths[size], size), default=0)
    kept = {name: values for name, values in table.columns.items() if values.size == rows}
    remarks = [
        f"{name}: {values.size} rows, the other columns have {rows}: another rate, or cut"
        for name, values in table.columns.items()
        if values.size != rows
    ]
    return replace(table, columns=kept, remarks=(*table.remarks, *remarks))
