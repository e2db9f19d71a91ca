"""Read columns of a foreign file by name: CSV, MATLAB .mat to version 7, Parquet, JSON. No map is known here."""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.files import csv_columns, json_columns
from hil.files.date_stamps import seconds_of
from hil.files.input_file import check_file
from hil.recording.arrow_files import MOST_BYTES, numbers, read_parquet

TEXT_ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".asc")
FEW_MISSING = 0.05  # share of rows without a value: more is a channel of another rate, or a damaged file
ENDINGS = f".csv, .mat, .parquet, .json, {', '.join(TEXT_ENDINGS[1:])}"


@dataclass(frozen=True)
class Foreign:
    """Columns of equal length, by name, NaN where a value is missing; `place` gives the place of row i (from 0)."""

    columns: dict[str, FloatArray]
    scalars: dict[str, float]
    place: Callable[[int], str]


def read_foreign(
    path: Path,
    wanted: Collection[str],
    wanted_scalars: Collection[str],
    form: csv_columns.CsvFormat,
    dates: str | None = None,
    missing: float = 0.0,
) -> Foreign:
    """The columns `wanted` and, from a .mat file, the scalars; `dates` is a column of dates, returned in seconds.

    Raises InputError with file, row and column: no such file or format, a missing column, text, infinity, values
    missing in a larger share of the rows than `missing`, columns of different length.
    """
    check_file(path, f"the path of a recording: {ENDINGS}", MOST_BYTES)
    wanted = tuple(name for name in dict.fromkeys(wanted) if name != dates)
    ending = path.suffix.lower()
    if wanted_scalars and ending != ".mat":
        raise InputError(
            f"{path}: the map takes {', '.join(wanted_scalars)} from the file by name, allowed with "
            ".mat files only; write the number into the map"
        )
    if ending in TEXT_ENDINGS:
        columns = csv_columns.read_columns(path, wanted, form, missing)
        if dates is not None:
            columns[dates] = seconds_of(csv_columns.read_texts(path, dates, form))
        place = partial(_line, path, form)
        _check(path, columns, place, missing)
        return Foreign(columns, {}, place)
    if ending == ".mat":
        variables = load_mat(path)
        columns = {name: _mat_column(path, variables, name) for name in wanted}
        scalars = {name: _mat_scalar(path, variables, name) for name in wanted_scalars}
    elif ending == ".parquet":
        columns, scalars = _parquet_columns(path, wanted), {}
        if dates is not None:
            columns[dates] = parquet_dates(path, dates)
    elif ending == ".json":
        content = json_columns.read_json(path)
        columns, scalars = {name: content.numbers(path, name) for name in wanted}, {}
        if dates is not None:
            columns[dates] = seconds_of([str(text) for text in content.lists.get(dates, [])])
    else:
        raise InputError(
            f"{path}: the ending {path.suffix!r} cannot be imported, allowed {ENDINGS}; "
            "export the recording to one of them"
        )
    place = partial(_row, path)
    _check(path, columns, place, missing)
    return Foreign(columns, scalars, place)


def _line(path: Path, form: csv_columns.CsvFormat, row: int) -> str:
    return f"{path}:{csv_columns.line_of_row(path, row, form)}"


def _row(path: Path, row: int) -> str:
    return f"{path}: row {row + 1}"


def parquet_dates(path: Path, name: str) -> FloatArray:
    """A column of time stamps of a Parquet file in seconds (n,) since midnight before the first."""
    column = read_parquet(path, (name,)).column(name)
    if not pa.types.is_timestamp(column.type):
        return seconds_of([str(text) for text in column.to_pylist()])
    nanoseconds = column.cast(pa.timestamp("ns", column.type.tz), safe=False).cast(pa.int64()).to_numpy()
    return np.asarray((nanoseconds - nanoseconds[0]) * 1e-9, dtype=np.float64)


def load_mat(path: Path) -> dict[str, Any]:
    """Variables of a .mat file; fields of structures as NAME.FIELD, signals of Simulink by their label."""
    from scipy.io import loadmat

    try:
        content = loadmat(path, struct_as_record=False, squeeze_me=False)
        variables: dict[str, Any] = {}
        for name, value in content.items():
            if not name.startswith("__"):
                _flatten(name, value, variables)
        return variables
    except NotImplementedError:
        raise InputError(
            f"{path}: is a .mat file of version 7.3 (HDF5), allowed up to version 7; "
            "save it in MATLAB with: save(NAME, '-v7')"
        ) from None
    except Exception as error:  # scipy raises many kinds for a damaged file
        raise InputError(f"{path}: is no readable .mat file ({error}); it is cut or damaged") from None


def _flatten(name: str, value: Any, into: dict[str, Any]) -> None:
    """Put a variable into `into`, its fields one by one if it is a structure or an array of structures."""
    structures = _structures(value)
    if not structures:
        into[name] = value
    for index, one in enumerate(structures):
        label = "".join(np.asarray(getattr(one, "label", "")).reshape(-1).astype(str))
        if label and hasattr(one, "values"):  # a signal of Simulink
            into[f"{name.rpartition('.')[0]}.{label}"] = one.values
            continue
        own = name if len(structures) == 1 else f"{name}.{index}"
        for key in one._fieldnames:
            _flatten(f"{own}.{key}", getattr(one, key), into)


def _structures(value: Any) -> list[Any]:
    """Structures in a variable, also in cells; none for numbers."""
    if hasattr(value, "_fieldnames"):
        return [value]
    values = np.asarray(value)
    return [one for item in values.reshape(-1) for one in _structures(item)] if values.dtype == object else []


def _mat_column(path: Path, variables: dict[str, Any], name: str) -> FloatArray:
    match = re.fullmatch(r"(.+)\[(\d+)\]", name)
    values = _mat_variable(path, variables, match[1] if match else name)
    if match and values.ndim == 2 and int(match[2]) < values.shape[1]:
        return np.ascontiguousarray(values[:, int(match[2])])
    if not match and values.size == max(values.shape, default=0):
        return values.reshape(-1)
    raise InputError(
        f"{path}: {name}: the variable has the shape {' x '.join(map(str, values.shape))}, allowed a "
        f"vector, or NAME[i] for column i (from 0) of a matrix; correct the map"
    )


def _mat_scalar(path: Path, variables: dict[str, Any], name: str) -> float:
    values = _mat_variable(path, variables, name)
    if values.size != 1 or not np.isfinite(values).all():
        raise InputError(
            f"{path}: {name}: given {values.size} values, allowed one finite number; write the number into the map"
        )
    return float(values.reshape(-1)[0])


def _mat_variable(path: Path, variables: dict[str, Any], name: str) -> FloatArray:
    if name not in variables:
        raise InputError(f"{path}: column {name!r} is missing; the file has {', '.join(variables)}")
    values = np.asarray(variables[name])
    if values.dtype.kind not in "fiub":
        raise InputError(
            f"{path}: {name}: given values of the type {values.dtype}, allowed real numbers; "
            "save the vector itself, not a structure or a text"
        )
    return values.astype(np.float64)


def _parquet_columns(path: Path, wanted: tuple[str, ...]) -> dict[str, FloatArray]:
    table = read_parquet(path, wanted)
    return {name: numbers(path, table, name) for name in wanted}


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
