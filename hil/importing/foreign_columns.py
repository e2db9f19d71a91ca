"""Read columns of a foreign file by name: CSV, MATLAB .mat to version 7, Parquet, JSON. No map is known here."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.date_stamps import DAY_S, seconds_of
from hil.files.input_file import check_file, first_bytes, is_text
from hil.importing.long_text import long_form
from hil.importing.map_file import CsvOptions
from hil.importing.mat_file import mat_column, mat_scalar
from hil.importing.on_change import held
from hil.importing.records import RECORD_ENDINGS, read_records
from hil.importing.slow_columns import rows_per_value
from hil.importing.text_lines import header_names, line_of, split_line
from hil.importing.text_rows import Cell, TextRows, read_rows
from hil.importing.variables import VARIABLE_ENDINGS, load_variables
from hil.recording.arrow_files import numbers, read_parquet

TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".tab", ".dat", ".asc", ".log", ".lvm", ".prn", ".psv")
LARGEST = 1e100  # of a measured number
FEW_MISSING = 0.05  # share of rows without a value: more is a channel of another rate, or a damaged file
_ENDINGS = (".csv", ".mat", ".parquet", *RECORD_ENDINGS, *VARIABLE_ENDINGS[1:], *TEXT_ENDINGS[1:])


@dataclass(frozen=True)
class Foreign:
    """Columns of equal length, by name, NaN where a value is missing; `place` gives the place of row i (from 0).

    `units` are those of columns whose cells hold theirs.
    """

    columns: dict[str, FloatArray]
    scalars: dict[str, float]
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)


def check_foreign(path: Path) -> None:
    """Refuse what is no file. Raises InputError."""
    check_file(path, f"the path of a recording: {', '.join(_ENDINGS)}")


def format_of(path: Path) -> str:
    """Format of a file: .csv (any text of rows), .mat (of variables by name), .parquet, .json (of records).

    A file with another ending is read as what it holds, if that is text. Raises InputError for another one.
    """
    ending = path.suffix.lower()
    if ending not in _ENDINGS and path.is_file() and is_text(first_bytes(path)):
        ending = ".txt"
    if ending not in _ENDINGS:
        raise InputError(
            f"{path}: the ending {path.suffix!r} cannot be imported, allowed {', '.join(_ENDINGS)} or text with any "
            "ending; export the recording to one of them"
        )
    if ending in RECORD_ENDINGS or (ending in TEXT_ENDINGS and long_form(path)):
        return ".json"
    return ".csv" if ending in TEXT_ENDINGS else ".mat" if ending in VARIABLE_ENDINGS else ending


def read_foreign(
    path: Path,
    wanted: Collection[str],
    wanted_scalars: Collection[str],
    options: CsvOptions,
    dates: Collection[str] = (),
    missing: float = 0.0,
    on_change: Collection[str] = (),
    sparse: Collection[str] = (),
) -> Foreign:
    """The columns `wanted` and, from a .mat file, the scalars; `dates` are columns of dates, returned in seconds.

    Those of `on_change` hold their last value where they have none; those of `sparse` may have no values in many rows.

    Raises InputError with file, row and column: no such file or format, a missing column, text, infinity, values
    missing in a larger share of the rows than `missing` of a column that is not slower, columns of different length.
    """
    check_foreign(path)
    wanted = tuple(name for name in dict.fromkeys(wanted) if name not in dates)
    if wanted_scalars and path.suffix.lower() != ".mat":
        raise InputError(
            f"{path}: the map takes {', '.join(wanted_scalars)} from the file by name, allowed with "
            ".mat files only; write the number into the map"
        )
    columns, scalars, stamps = dict[str, FloatArray](), dict[str, float](), dict[str, FloatArray]()
    lines: NDArray[np.int64] | None = None
    notes: tuple[str, ...] = ()
    units = dict[str, str]()
    match format_of(path):
        case ".csv":
            rows = read_rows(path, header_names(path, options), options)
            columns, stamps = _chosen(path, rows, wanted, dates)
            lines, notes, units = rows.lines, rows.notes, rows.units
        case ".mat":
            variables = load_variables(path).arrays
            columns = {name: mat_column(path, variables, name) for name in wanted}
            scalars = {name: mat_scalar(path, variables, name) for name in wanted_scalars}
        case ".parquet":
            table = read_parquet(path, wanted)
            columns = {name: numbers(path, table, name) for name in wanted}
            stamps = {name: parquet_dates(path, name) for name in dates}
        case _:
            records = read_records(path)
            content, notes, units = records.columns, records.notes, records.cell_units
            for name in wanted:
                _refuse_text(path, name, records.texts.get(name), "finite number")
            columns = {name: content.numbers(path, name) for name in wanted}
            stamps = {name: seconds_of([str(text) for text in content.lists.get(name, [])]) for name in dates}

    columns = {name: as_measured(values) for name, values in columns.items()}
    columns |= {name: held(columns[name]) for name in on_change}

    def place(row: int) -> str:
        return f"{path}: row {row + 1}" if lines is None else f"{path}:{lines[row]}"

    def given(row: int, name: str) -> str:
        if lines is None:
            return f"{(columns | stamps)[name][row]}"
        text = split_line(line_of(path, int(lines[row]), options.encoding), options.delimiter)
        column = options.series.value if options.series and name != options.series.time else name
        index = header_names(path, options).index(column)
        return repr(text[index]) if index < len(text) else "no field"

    checked = {name: values for name, values in (columns | stamps).items() if name not in sparse}
    _check(checked, path, place, given, missing)
    return Foreign(columns | stamps, scalars, place, notes, units)


def _chosen(
    path: Path, rows: TextRows, wanted: Collection[str], dates: Collection[str]
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """The columns `wanted` and `dates` of the rows of a text file. Raises InputError: absent, or text among them."""
    names = (*rows.numbers, *rows.dates)
    for name in (*wanted, *dates):
        if name not in names:
            raise InputError(f"{path}: column {name!r} is missing; the file has {listed(names)}")
        of_kind = name in (rows.dates if name in dates else rows.numbers)
        if name in rows.texts or not of_kind:
            kind = Cell(int(rows.lines[0]), "dates" if name in rows.dates else "numbers")
            number = "number with its unit" if name in rows.units else "finite number"
            _refuse_text(path, name, rows.texts.get(name, kind), "date" if name in dates else number)
    return {name: rows.numbers[name] for name in wanted}, {name: rows.dates[name] for name in dates}


def _refuse_text(path: Path, name: str, cell: Cell | None, allowed: str) -> None:
    if cell is not None:
        raise InputError(
            f"{path}:{cell.line}: {name}: given {cell.text!r}, allowed a {allowed}; "
            "leave the column out of the map, or import the part of the file before it"
        )


def as_measured(values: NDArray[Any]) -> FloatArray:
    """Numbers of any type as float64; NaN for one that no sensor gives and whose square has no value."""
    with np.errstate(invalid="ignore"):  # a damaged number of 4 bytes
        numbers = values.astype(np.float64)
        return np.where(np.isfinite(numbers) & (np.abs(numbers) > LARGEST), np.nan, numbers)


def parquet_dates(path: Path, name: str) -> FloatArray:
    """A column of time stamps of a Parquet file in seconds (n,) since midnight before the first."""
    column = read_parquet(path, (name,)).column(name)
    if pa.types.is_dictionary(column.type):
        codes = column.unify_dictionaries().combine_chunks()
        words = [*map(str, codes.dictionary.to_pylist()), ""]
        return seconds_of([words[code] for code in codes.indices.fill_null(-1).to_pylist()])
    if not pa.types.is_timestamp(column.type):
        return seconds_of([str(number) for number in column.to_pylist()])
    nanoseconds = column.cast(pa.timestamp("ns", column.type.tz), safe=False).cast(pa.int64()).to_numpy()
    day = round(DAY_S * 1e9)
    return np.asarray((nanoseconds - nanoseconds[0] // day * day) * 1e-9, dtype=np.float64)


def _check(
    columns: dict[str, FloatArray],
    path: Path,
    place: Callable[[int], str],
    given: Callable[[int, str], str],
    share: float,
) -> None:
    first = next(iter(columns), "")
    for name, values in columns.items():
        if values.size != columns[first].size:
            raise InputError(
                f"{path}: {name}: given {values.size} rows, {first} has {columns[first].size}; "
                "all columns must be equally long"
            )
    for name, values in columns.items():
        missing = np.isnan(values)
        few = bool(missing.mean() <= share) or (share > 0.0 and rows_per_value(values) is not None)
        bad = np.flatnonzero(np.isinf(values) | (missing & (not few)))
        if bad.size:
            row = int(bad[0])
            raise InputError(
                f"{place(row)}: {name}: given {given(row, name)}, allowed a finite number"
                + (f", or none in up to {100.0 * share:g} % of the rows" if share else "")
                + "; import the part of the file before it, or write 'missing: leave_out' into the map"
            )
