"""Read number columns of a CSV file with pyarrow; every error names line and column.

pyarrow does not always report where a file is wrong. In that case a slow second pass over the text finds the first bad
field.
"""

import csv
import math
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.input_file import check_values, lines_of

Columns = dict[str, FloatArray]


@dataclass(frozen=True)
class CsvFormat:
    """Format of a CSV file: `skip_lines` above the header, `skip_rows` between header and data.

    The delimiter " " stands for one or more blanks.
    """

    delimiter: str = ","
    decimal_point: str = "."
    skip_lines: int = 0
    skip_rows: int = 0
    column_names: tuple[str, ...] | None = None  # for a file without a header
    encoding: str = "utf-8"


PLAIN = CsvFormat()


def read_header(path: Path, form: CsvFormat = PLAIN) -> tuple[str, ...]:
    """Names of the columns. Raises InputError for an empty file, a repeated name, or text that is no CSV."""
    with _opened(path, form) as file:
        lines = _rows(path, file, form)
        line, names = next(lines, (0, []))
    if form.column_names is not None:
        names = list(form.column_names)
    elif line == 0:
        raise InputError(f"{path}: the file is empty; give a CSV file with a header and rows of numbers")
    repeated = [name for name, times in Counter(names).items() if times > 1]
    if repeated:
        raise InputError(
            f"{path}:{line}: {repeated[0]}: stands twice in the header, allowed once; rename or remove one"
        )
    return tuple(names)


def read_columns(
    path: Path, wanted: Collection[str], form: CsvFormat = PLAIN, missing: float = 0.0
) -> dict[str, FloatArray]:
    """The columns named in `wanted`, as numbers of equal length: finite, or NaN in a share of up to `missing` rows.

    Raises InputError with file, line and column: a missing column, text, an empty field, NaN or
    infinity, a row of another length, no rows.
    """
    names = read_header(path, form)
    _refuse_absent(path, wanted, names)
    try:
        columns = _parsed(path, names, wanted, form)
        problem = None
    except (pa.ArrowException, UnicodeError) as error:
        columns, problem = {}, error
    if problem is not None or any(
        np.isinf(values).any() or np.isnan(values).mean() > missing for values in columns.values()
    ):
        _raise_first_bad_field(path, names, wanted, form)
        raise InputError(f"{path}: cannot be read as CSV: {problem}; correct the file")
    return columns


def read_whole(path: Path, names: Collection[str], wanted: Collection[str], form: CsvFormat) -> Columns | None:
    """The columns `wanted` where every row has a finite number in each; None for any other file.

    This is fast; the reader of other files takes each field in turn.
    """
    try:
        columns = _parsed(path, names, wanted, form)
    except (pa.ArrowException, UnicodeError, InputError):
        return None
    return columns if all(np.isfinite(values).all() for values in columns.values()) else None


def _parsed(path: Path, names: Collection[str], wanted: Collection[str], form: CsvFormat) -> Columns:
    batches = pacsv.open_csv(
        _with_single_blanks(path, form) if form.delimiter == " " else path,
        read_options=pacsv.ReadOptions(
            column_names=list(names),
            skip_rows=line_of_row(path, 0, form) - 1,
            encoding=form.encoding,
            use_threads=False,
        ),
        parse_options=pacsv.ParseOptions(delimiter=form.delimiter),
        convert_options=pacsv.ConvertOptions(
            include_columns=list(wanted),
            column_types=dict.fromkeys(wanted, pa.float64()),
            decimal_point=form.decimal_point,
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


def _refuse_absent(path: Path, wanted: Collection[str], names: tuple[str, ...]) -> None:
    absent = [name for name in wanted if name not in names]
    if absent:
        raise InputError(f"{path}: column {absent[0]!r} is missing; the file has {listed(names)}")


def line_of_row(path: Path, row: int, form: CsvFormat = PLAIN) -> int:
    """Line in the file (from 1) of data row `row` (from 0); blank lines and headers count as lines.

    Raises InputError if the file has no such row.
    """
    with _opened(path, form) as file:
        for line, _ in islice(_data_rows(path, file, form), row, None):
            return line
    raise InputError(f"{path}: there is no row {row + 1} of numbers below the header; give a file with rows")


def _opened(path: Path, form: CsvFormat) -> TextIO:
    try:
        encoding = "utf-8-sig" if form.encoding.lower() in ("utf-8", "utf8") else form.encoding
        return path.open(encoding=encoding, newline="")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a CSV file") from None
    except LookupError:
        raise InputError(
            f"{path}: given the encoding {form.encoding!r}, allowed one that Python knows; give utf-8 or latin-1"
        ) from None


def _with_single_blanks(path: Path, form: CsvFormat) -> pa.BufferReader:
    with _opened(path, form) as file:
        text = "\n".join(" ".join(line.split()) for line in lines_of(path, file))
    return pa.BufferReader(text.encode(form.encoding))


def _rows(path: Path, file: TextIO, form: CsvFormat) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each line that is not blank, from the header on."""
    lines: Iterator[str] = islice(lines_of(path, file), form.skip_lines, None)
    if form.delimiter == " ":
        lines = (" ".join(line.split()) for line in lines)
    reader = csv.reader(lines, delimiter=form.delimiter)
    try:
        for fields in reader:
            if fields:
                yield reader.line_num + form.skip_lines, fields
    except (UnicodeError, csv.Error) as error:
        line = reader.line_num + form.skip_lines + 1
        raise InputError(f"{path}:{line}: is not text of a CSV file ({error}); give a CSV file") from None


def _data_rows(path: Path, file: TextIO, form: CsvFormat) -> Iterator[tuple[int, list[str]]]:
    return islice(_rows(path, file, form), (form.column_names is None) + form.skip_rows, None)


def _raise_first_bad_field(path: Path, names: tuple[str, ...], wanted: Collection[str], form: CsvFormat) -> None:
    places = sorted((names.index(name), name) for name in wanted)
    with _opened(path, form) as file:
        for line, fields in _data_rows(path, file, form):
            if len(fields) != len(names):
                raise InputError(
                    f"{path}:{line}: given {len(fields)} fields, the header has {len(names)}; "
                    "the row is cut or damaged: correct or remove it"
                )
            for index, name in places:
                text = fields[index].strip()
                if not _is_finite_number(text, form.decimal_point):
                    given = repr(text) if text else "an empty field"
                    raise InputError(
                        f"{path}:{line}: {name}: given {given}, allowed a finite number; "
                        "correct the value or cut the recording before it"
                    )


def _is_finite_number(text: str, decimal_point: str) -> bool:
    if "_" in text or ("." in text and decimal_point != "."):  # Python reads 1_0, a CSV reader does not
        return False
    try:
        return math.isfinite(float(text.replace(decimal_point, ".")))
    except ValueError:
        return False
