"""Read columns of a foreign file by name: CSV, MATLAB .mat to version 7, Parquet, JSON. No map is known here."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.files import csv_columns, json_columns
from hil.files.date_stamps import seconds_of
from hil.files.input_file import check_file
from hil.importing.mat_file import load_mat, mat_column, mat_scalar
from hil.importing.on_change import held
from hil.recording.arrow_files import numbers, read_parquet

TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".asc")
FEW_MISSING = 0.05  # share of rows without a value: more is a channel of another rate, or a damaged file
_ENDINGS = (".csv", ".mat", ".parquet", ".json", *TEXT_ENDINGS[1:])


@dataclass(frozen=True)
class Foreign:
    """Columns of equal length, by name, NaN where a value is missing; `place` gives the place of row i (from 0)."""

    columns: dict[str, FloatArray]
    scalars: dict[str, float]
    place: Callable[[int], str]


def check_foreign(path: Path) -> None:
    """Refuse what is no file. Raises InputError."""
    check_file(path, f"the path of a recording: {', '.join(_ENDINGS)}")


def format_of(path: Path) -> str:
    """Format of a file by its ending: .csv (any text), .mat, .parquet, .json. Raises InputError for another one."""
    ending = path.suffix.lower()
    if ending not in _ENDINGS:
        raise InputError(
            f"{path}: the ending {path.suffix!r} cannot be imported, allowed {', '.join(_ENDINGS)}; "
            "export the recording to one of them"
        )
    return ".csv" if ending in TEXT_ENDINGS else ending


def read_foreign(
    path: Path,
    wanted: Collection[str],
    wanted_scalars: Collection[str],
    form: csv_columns.CsvFormat,
    dates: str | None = None,
    missing: float = 0.0,
    on_change: Collection[str] = (),
) -> Foreign:
    """The columns `wanted` and, from a .mat file, the scalars; `dates` is a column of dates, returned in seconds.

    Those of `on_change` hold their last value where they have none.

    Raises InputError with file, row and column: no such file or format, a missing column, text, infinity, values
    missing in a larger share of the rows than `missing`, columns of different length.
    """
    check_foreign(path)
    wanted = tuple(name for name in dict.fromkeys(wanted) if name != dates)
    if wanted_scalars and path.suffix.lower() != ".mat":
        raise InputError(
            f"{path}: the map takes {', '.join(wanted_scalars)} from the file by name, allowed with "
            ".mat files only; write the number into the map"
        )
    columns, scalars, stamps = dict[str, FloatArray](), dict[str, float](), dict[str, FloatArray]()
    match format_of(path):
        case ".csv":
            rest = [name for name in wanted if name not in on_change]
            for names, share in ((rest, missing), (on_change, 1.0)):
                columns |= csv_columns.read_columns(path, names, form, share) if names else {}
            if dates is not None:
                stamps[dates] = seconds_of(csv_columns.read_texts(path, dates, form))
        case ".mat":
            variables = load_mat(path)
            columns = {name: mat_column(path, variables, name) for name in wanted}
            scalars = {name: mat_scalar(path, variables, name) for name in wanted_scalars}
        case ".parquet":
            table = read_parquet(path, wanted)
            columns = {name: numbers(path, table, name) for name in wanted}
            if dates is not None:
                stamps[dates] = parquet_dates(path, dates)
        case _:
            content = json_columns.read_json(path)
            columns = {name: content.numbers(path, name) for name in wanted}
            if dates is not None:
                stamps[dates] = seconds_of([str(text) for text in content.lists.get(dates, [])])

    columns |= {name: held(columns[name]) for name in on_change}

    def place(row: int) -> str:
        text = format_of(path) == ".csv"
        return f"{path}:{csv_columns.line_of_row(path, row, form)}" if text else f"{path}: row {row + 1}"

    _check(path, columns | stamps, place, missing)
    return Foreign(columns | stamps, scalars, place)


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
    return np.asarray((nanoseconds - nanoseconds[0]) * 1e-9, dtype=np.float64)


def _check(path: Path, columns: dict[str, FloatArray], place: Callable[[int], str], share: float) -> None:
    first, *others = columns.items()
    for name, values in others:
        if values.size != first[1].size:
            raise InputError(
                f"{path}: {name}: given {values.size} rows, {first[0]} has {first[1].size}; "
                "all columns must be equally long"
            )
    for name, values in columns.items():
        missing = np.isnan(values)
        few = missing.mean() <= share
        bad = np.flatnonzero(np.isinf(values) | (missing & ~np.bool_(few)))
        if bad.size:
            raise InputError(
                f"{place(int(bad[0]))}: {name}: given {values[bad[0]]}, allowed a finite number"
                + (f", or none in up to {100.0 * share:g} % of the rows" if share else "")
                + "; correct the value, cut the recording before it, or write 'missing: leave_out' into the map"
            )
