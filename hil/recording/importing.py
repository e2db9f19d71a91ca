"""Import a foreign recording (CSV, MATLAB .mat to version 7, Parquet) by a map file (`hil.recording.import_map`)."""

import hashlib
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hil.arrays import FloatArray
from hil.channels import CHANNELS, AxisChannels
from hil.errors import InputError
from hil.files import csv_columns
from hil.files.yaml_model import load_model
from hil.quantities import si_factor
from hil.recording.import_map import RecordingMap
from hil.recording.recording import Recording, check_columns, check_finite

ENDINGS = ".csv, .mat, .parquet"
MAPS = Path(__file__).parents[1] / "maps"


def import_recording(source: str | Path, map_path: str | Path) -> Recording:
    """Read `source` (.csv, .mat, .parquet) by the map file `map_path`, or by a shipped map's name (emps).

    Missing channels are derived: velocity_command_m_s by central differences of the position command; torque from
    torque command or vice versa (on a linear axis force). The metadata list them (`derived`) and the source of each
    channel (`channels`).
    Raises InputError with file, row and column: wrong format, a missing column, text, NaN or infinity, columns of
    different length, an irregular clock.
    """
    source, map_path = Path(source), _find_map(map_path)
    the_map = load_model(map_path, RecordingMap)
    wanted = [entry.column for entry in the_map.channels.values()]
    if the_map.time is not None:
        wanted.append(the_map.time.column)
    gains = {entry.gain for entry in the_map.channels.values() if isinstance(entry.gain, str)}
    foreign = _read_foreign(source, wanted, sorted(gains), the_map.csv.format())

    columns = {"time_s": _time_s(the_map, foreign.columns)}
    origins = {}
    for name, entry in the_map.channels.items():
        gain = foreign.scalars[entry.gain] if isinstance(entry.gain, str) else 1.0
        factor = entry.factor_to(CHANNELS[name].unit, the_map.lead_m, gain)
        assert factor is not None  # the map was validated
        columns[name] = factor * foreign.columns[entry.column] + entry.offset
        origins[name] = {"column": entry.column, "factor": factor, "offset": entry.offset}
    clock = the_map.time.column if the_map.time is not None else "sample_rate_hz"
    period_s = check_columns(columns, lambda row: f"{foreign.place(row)}: {clock}")
    derived = _derive(columns, the_map.axis, period_s)
    metadata: dict[str, Any] = {
        "source": source.name,
        "source_sha256": _sha256(source),
        "map": map_path.name,
        "about": the_map.about,
        "channels": origins,
        "derived": derived,
        "clock": _describe_clock(columns["time_s"], period_s),
    }
    return Recording(source.stem, columns, period_s, metadata)


def _find_map(map_path: str | Path) -> Path:
    shipped = MAPS / f"{map_path}.yaml"
    return shipped if not Path(map_path).exists() and shipped.is_file() else Path(map_path)


def _time_s(the_map: RecordingMap, raw: dict[str, FloatArray]) -> FloatArray:
    if the_map.time is not None:
        factor = si_factor(the_map.time.unit, "s")
        assert factor is not None
        return np.asarray(factor * raw[the_map.time.column], dtype=np.float64)
    assert the_map.sample_rate_hz is not None
    rows = next(iter(raw.values())).size
    return np.asarray(np.arange(rows) / the_map.sample_rate_hz, dtype=np.float64)


def _derive(columns: dict[str, FloatArray], axis: AxisChannels, period_s: float) -> dict[str, str]:
    """Add the channels that follow from others; return how each was derived."""
    derived = {}
    if axis.velocity_command not in columns and axis.position_command in columns:
        columns[axis.velocity_command] = np.gradient(columns[axis.position_command], period_s)
        derived[axis.velocity_command] = f"central differences of {axis.position_command}"
    for name, other in ((axis.torque, axis.torque_command), (axis.torque_command, axis.torque)):
        if name not in columns and other in columns:
            columns[name] = columns[other].copy()
            derived[name] = f"copy of {other}, the only one recorded"
    return derived


def _describe_clock(time_s: FloatArray, period_s: float) -> str:
    """Describe the largest deviation of the time stamps from start + tick x period."""
    deviation_s = np.abs(time_s - time_s[0] - np.arange(time_s.size) * period_s).max()
    return f"period {period_s:.9g} s; stamps within {deviation_s:.2g} s of start + tick x period"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class _Foreign:
    """Finite columns of equal length, by name; `place` gives the place of row i (from 0) in the file."""

    columns: dict[str, FloatArray]
    scalars: dict[str, float]
    place: Callable[[int], str]


def _read_foreign(
    path: Path, wanted: Collection[str], wanted_scalars: Collection[str], form: csv_columns.CsvFormat
) -> _Foreign:
    """The columns `wanted` and, from a .mat file, the scalars.

    Raises InputError with file, row and column: no such file or format, a missing column, text, NaN or
    infinity, columns of different length.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the path of a recording: {ENDINGS}")
    wanted = tuple(dict.fromkeys(wanted))
    ending = path.suffix.lower()
    if wanted_scalars and ending != ".mat":
        raise InputError(
            f"{path}: the map takes {', '.join(wanted_scalars)} from the file by name, allowed with "
            ".mat files only; write the number into the map"
        )
    if ending == ".csv":
        return _Foreign(
            csv_columns.read_columns(path, wanted, form),
            {},
            lambda row: f"{path}:{csv_columns.line_of_row(path, row, form)}",
        )
    if ending == ".mat":
        variables = _load_mat(path)
        columns = {name: _mat_column(path, variables, name) for name in wanted}
        scalars = {name: _mat_scalar(path, variables, name) for name in wanted_scalars}
    elif ending == ".parquet":
        columns, scalars = _parquet_columns(path, wanted), {}
    else:
        raise InputError(
            f"{path}: the ending {path.suffix!r} cannot be imported, allowed {ENDINGS}; "
            "export the recording to one of them"
        )
    _check(path, columns)
    return _Foreign(columns, scalars, lambda row: f"{path}: row {row + 1}")


def _load_mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        return {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    except NotImplementedError:
        raise InputError(
            f"{path}: is a .mat file of version 7.3 (HDF5), allowed up to version 7; "
            "save it in MATLAB with: save(NAME, '-v7')"
        ) from None
    except Exception as error:  # scipy raises many kinds for a damaged file
        raise InputError(f"{path}: is no readable .mat file ({error}); it is cut or damaged") from None


def _mat_column(path: Path, variables: dict[str, Any], name: str) -> FloatArray:
    match = re.fullmatch(r"(\w+)\[(\d+)\]", name)
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
    try:
        names = pq.read_schema(path).names
        missing = [name for name in wanted if name not in names]
        if missing:
            raise InputError(f"{path}: column {missing[0]!r} is missing; the file has {', '.join(names)}")
        table = pq.read_table(path, columns=list(wanted))
    except (pa.ArrowException, OSError) as error:
        raise InputError(
            f"{path}: is no readable Parquet file ({str(error).splitlines()[0]}); it is cut or damaged"
        ) from None
    for name in wanted:
        kind = table.schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            raise InputError(f"{path}: {name}: given {kind} values, allowed numbers; convert the column")
    return {name: table.column(name).to_numpy().astype(np.float64) for name in wanted}


def _check(path: Path, columns: dict[str, FloatArray]) -> None:
    first, *others = columns.items()
    for name, values in others:
        if values.size != first[1].size:
            raise InputError(
                f"{path}: {name}: given {values.size} rows, {first[0]} has {first[1].size}; "
                "all columns must be equally long"
            )
    check_finite(columns, lambda row: f"{path}: row {row + 1}")
