"""Read all columns of numbers of a foreign file, without a map.

What is no number becomes NaN here; the import by the drafted map then reads the wanted columns strictly and names line
and column of what is wrong.
"""

import csv
from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.files import json_columns
from hil.files.date_stamps import is_date, seconds_of
from hil.files.input_file import lines_of
from hil.importing.csv_dialect import find_dialect, number_of
from hil.importing.foreign_columns import check_foreign, format_of, parquet_dates
from hil.importing.header_values import HeaderValue, header_values
from hil.importing.lexicon import Constant
from hil.importing.map_file import CsvOptions
from hil.importing.mat_file import load_mat
from hil.importing.unit_lines import described, told_units
from hil.recording.arrow_files import is_number, numbers, parquet_schema, read_parquet, stored_unit

MOST_ROWS = 200_000  # read of a text file for the draft: minutes of a recording
WIDEST = 64  # columns of a matrix in a .mat file: a wider one is no table of channels


@dataclass(frozen=True, eq=False)
class ForeignTable:
    """Columns of equal length, NaN where a field is no number; units and scalars as the file gives them.

    `constants` are what lines above the numbers, or scalars, give by a name that is known. `dates` are columns of dates
    or times of day, in seconds; `texts` is the first text among the numbers of a column, `words` what a line above says
    of it.
    """

    path: Path
    columns: dict[str, FloatArray]
    units: dict[str, str]
    scalars: dict[str, float] = field(default_factory=dict)
    csv: CsvOptions = field(default_factory=CsvOptions)
    constants: dict[Constant, HeaderValue] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    dates: frozenset[str] = frozenset()
    texts: dict[str, str] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)


def read_table(path: Path) -> ForeignTable:
    """Read `path`. Raises InputError: no such file, empty, damaged, binary, another format, no columns of numbers."""
    check_foreign(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; give a file with rows of numbers")
    readers = {".csv": _text, ".mat": _mat, ".parquet": _parquet, ".json": _json}
    table = _equal_length(readers[format_of(path)](path))
    rows = max((values.size for values in table.columns.values()), default=0)
    if len(table.columns) < 2 or rows < 3:
        raise InputError(
            f"{path}: given {len(table.columns)} columns of numbers with {rows} rows, allowed two columns and three "
            "rows or more; give a file with the channels of a motion"
        )
    return table


def _text(path: Path) -> ForeignTable:
    dialect = find_dialect(path)
    options = dialect.options
    encoding = "utf-8-sig" if options.encoding == "utf-8" else options.encoding
    rows: list[list[str]] = []
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        below = islice(lines_of(path, file), options.skip_lines, None)
        lines = (
            (" ".join(line.split()) for line in below)
            if options.delimiter == " "
            else (line.replace("\0", "") for line in below)
        )
        skip = (options.column_names is None) + options.skip_rows
        try:
            reader = (row for row in csv.reader(lines, delimiter=options.delimiter) if row)
            rows = list(islice(reader, skip, skip + MOST_ROWS))
        except csv.Error as error:
            raise InputError(f"{path}: is not text of a CSV file ({error}); give a CSV file") from None
    columns, remarks = {}, []
    dates, texts = set[str](), dict[str, str]()
    for index, name in enumerate(dialect.names):
        fields = [row[index] if index < len(row) else "" for row in rows]
        given = [number_of(field, options.decimal_point) for field in fields]
        values = np.array(given, dtype=np.float64)  # NaN for text
        if np.isfinite(values).mean() > 0.01:
            columns[name] = values
            if None in given:
                texts[name] = fields[given.index(None)]
        elif fields and is_date(fields[0]):
            columns[name] = seconds_of(fields)
            dates.add(name)
        elif name.strip():
            remarks.append(f"{name.strip()}: text such as {next((f for f in fields if f.strip()), '')!r}, no numbers")
    told = described(dialect.above, dialect.names)
    units = {name: unit for name, (_, unit) in told.items()} | told_units(dialect.above, dialect.names)
    units |= {name: unit.strip("[]() ") for name, unit in zip(dialect.names, dialect.units, strict=True) if unit}
    constants, words = header_values(dialect.above, {}), {name: text for name, (text, _) in told.items()}
    return ForeignTable(path, columns, units, {}, options, constants, tuple(remarks), frozenset(dates), texts, words)


def _mat(path: Path) -> ForeignTable:
    columns, scalars, others = dict[str, FloatArray](), dict[str, float](), []
    for name, variable in load_mat(path).items():
        values = np.asarray(variable)
        if values.dtype.kind not in "fiub":
            others.append(name)
        elif values.size == 1:
            scalars[name] = float(values.reshape(-1)[0])
        elif values.size == max(values.shape):
            columns[name] = values.reshape(-1).astype(np.float64)
        elif values.ndim == 2 and values.shape[1] <= WIDEST and values.shape[0] > values.shape[1]:
            columns |= {f"{name}[{index}]": values[:, index].astype(np.float64) for index in range(values.shape[1])}
        else:
            others.append(name)
    remarks = [f"{name}: neither a number, a vector nor a matrix with a column per channel" for name in others]
    if not columns:
        raise InputError(
            f"{path}: holds no vector of numbers (there are {', '.join(others) or 'no variables'}), allowed a vector "
            "per channel or a matrix with a column per channel; save the vectors themselves, not a structure"
        )
    return ForeignTable(path, columns, {}, scalars, constants=header_values((), scalars), remarks=tuple(remarks))


def _parquet(path: Path) -> ForeignTable:
    schema = parquet_schema(path)
    wanted = [one.name for one in schema if is_number(one.type) or pa.types.is_timestamp(one.type)]
    table = read_parquet(path, wanted)
    columns, units, remarks = {}, {}, []
    dates = set[str]()
    for one in schema:
        if is_number(one.type):
            columns[one.name] = numbers(path, table, one.name)
            unit = stored_unit(schema, one.name)
            if unit:
                units[one.name] = unit
        elif pa.types.is_timestamp(one.type):
            columns[one.name] = parquet_dates(path, one.name)
            dates.add(one.name)
        else:
            remarks.append(f"{one.name}: {one.type} values, no numbers; convert the column to use it")
    return ForeignTable(path, columns, units, remarks=tuple(remarks), dates=frozenset(dates))


def _json(path: Path) -> ForeignTable:
    content = json_columns.read_json(path)
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
    constants = header_values((), content.scalars)
    return ForeignTable(
        path,
        columns,
        content.units,
        content.scalars,
        constants=constants,
        remarks=tuple(remarks),
        dates=frozenset(dates),
    )


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
