"""Read number columns of a CSV file with pyarrow; every error names line and column.

pyarrow does not always report where a file is wrong. In that case a slow second pass over the text finds the first bad
field.
"""

import csv
import math
from collections import Counter
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.input_file import check_values, lines_of


def read_header(path: Path) -> tuple[str, ...]:
    """Names of the columns. Raises InputError for an empty file, a repeated name, or text that is no CSV."""
    with _opened(path) as file:
        line, names = next(_rows(path, file), (0, []))
    if line == 0:
        raise InputError(f"{path}: the file is empty; give a CSV file with a header and rows of numbers")
    repeated = [name for name, times in Counter(names).items() if times > 1]
    if repeated:
        raise InputError(
            f"{path}:{line}: {repeated[0]}: stands twice in the header, allowed once; rename or remove one"
        )
    return tuple(names)


def read_columns(path: Path, wanted: Collection[str]) -> dict[str, FloatArray]:
    """The columns named in `wanted`, as finite numbers of equal length.

    Raises InputError with file, line and column: a missing column, text, an empty field, NaN or
    infinity, a row of another length, no rows.
    """
    names = read_header(path)
    absent = [name for name in wanted if name not in names]
    if absent:
        raise InputError(f"{path}: column {absent[0]!r} is missing; the file has {listed(names)}")
    lines_above = line_of_row(path, 0) - 1
    try:
        columns = _parsed(path, names, wanted, lines_above)
        problem = None
    except (pa.ArrowException, UnicodeError) as error:
        columns, problem = {}, error
    if problem is not None or not all(np.isfinite(values).all() for values in columns.values()):
        _raise_first_bad_field(path, names, wanted)
        raise InputError(f"{path}: cannot be read as CSV: {problem}; correct the file")
    return columns


def _parsed(path: Path, names: Collection[str], wanted: Collection[str], lines_above: int) -> dict[str, FloatArray]:
    batches = pacsv.open_csv(
        path,
        read_options=pacsv.ReadOptions(column_names=list(names), skip_rows=lines_above, use_threads=False),
        convert_options=pacsv.ConvertOptions(
            include_columns=list(wanted), column_types=dict.fromkeys(wanted, pa.float64())
        ),
    )
    table = _table(path, batches, len(wanted))
    return {name: table.column(name).to_numpy() for name in wanted}


def _table(path: Path, batches: Any, columns: int) -> pa.Table:
    """The rows of a reader, counted as they come: two characters may be a value of 8 bytes."""
    read, rows = [], 0
    for batch in batches:
        read.append(batch)
        rows += batch.num_rows
        check_values(path, rows * columns, f"more than {rows} rows of {columns} columns")
    return pa.Table.from_batches(read, batches.schema)


def line_of_row(path: Path, row: int) -> int:
    """Line in the file (from 1) of data row `row` (from 0); blank lines and the header count as lines.

    Raises InputError if the file has no such row.
    """
    with _opened(path) as file:
        for line, _ in islice(_data_rows(path, file), row, None):
            return line
    raise InputError(f"{path}: there is no row {row + 1} of numbers below the header; give a file with rows")


def _opened(path: Path) -> TextIO:
    try:
        return path.open(encoding="utf-8-sig", newline="")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a CSV file") from None


def _rows(path: Path, file: TextIO) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each line that is not blank, from the header on."""
    reader = csv.reader(lines_of(path, file))
    try:
        for fields in reader:
            if fields:
                yield reader.line_num, fields
    except (UnicodeError, csv.Error) as error:
        line = reader.line_num + 1
        raise InputError(f"{path}:{line}: is not text of a CSV file ({error}); give a CSV file") from None


def _data_rows(path: Path, file: TextIO) -> Iterator[tuple[int, list[str]]]:
    return islice(_rows(path, file), 1, None)


def _raise_first_bad_field(path: Path, names: tuple[str, ...], wanted: Collection[str]) -> None:
    places = sorted((names.index(name), name) for name in wanted)
    with _opened(path) as file:
        for line, fields in _data_rows(path, file):
            if len(fields) != len(names):
                raise InputError(
                    f"{path}:{line}: given {len(fields)} fields, the header has {len(names)}; "
                    "the row is cut or damaged: correct or remove it"
                )
            for index, name in places:
                text = fields[index].strip()
                if not _is_finite_number(text):
                    given = repr(text) if text else "an empty field"
                    raise InputError(
                        f"{path}:{line}: {name}: given {given}, allowed a finite number; "
                        "correct the value or cut the recording before it"
                    )


def _is_finite_number(text: str) -> bool:
    if "_" in text:  # Python reads 1_0, a CSV reader does not
        return False
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
