"""Parquet files and Arrow streams that may be damaged or of any size, read into bounded memory.

A few bytes of a compressed column stand for any number of equal values: the size in memory is known before reading from
the number of rows, not from the size of the file.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.files.input_file import check_file, parsing

MOST_VALUES = 50_000_000  # rows x columns of 8 bytes: 400 MB, 75 min at 1 kHz with 11 channels
MOST_BYTES = 2_000_000_000  # of a file: far above MOST_VALUES without compression
METADATA_KEY = b"hil"  # of the schema: the metadata as JSON
FORMATS = "the path of a recording: .parquet, .arrows (a run that was not closed) or .csv"
_DAMAGED = "it is cut or damaged: read the .arrows file of the run if there is one"
_UNWRITTEN = "nothing of the run was written yet, or it is another file"
_STREAM_END = b"\xff\xff\xff\xff\x00\x00\x00\x00"  # Arrow IPC: the end-of-stream marker


class StreamRows(NamedTuple):
    """The complete batches of an Arrow stream; problem: why the next one could not be read; closed: it has an end."""

    table: pa.Table
    batches: int
    problem: str
    closed: bool


def read_parquet(path: Path, wanted: Collection[str] | None = None) -> pa.Table:
    """Columns of a Parquet file, by default all. Raises InputError: damaged, a column missing, too many values."""
    check_file(path, FORMATS, MOST_BYTES)
    with parsing(path, "Parquet file", _DAMAGED):
        with pq.ParquetFile(path, memory_map=True) as file:
            names, rows = file.schema_arrow.names, file.metadata.num_rows
            missing = [name for name in wanted or () if name not in names]
            if missing:
                raise InputError(f"{path}: column {missing[0]!r} is missing; the file has {', '.join(names)}")
            _refuse_size(path, rows, len(names if wanted is None else wanted))
            table = file.read(None if wanted is None else list(wanted), use_threads=False)
        table.validate()
        if table.num_rows != rows:
            raise ValueError(f"{table.num_rows} rows of {rows}")
    return table


def read_stream(path: Path) -> StreamRows:
    """The complete batches of an Arrow stream, closed or not. Raises InputError: no stream, or too many values."""
    check_file(path, FORMATS, MOST_BYTES)
    batches, problem = [], ""
    with parsing(path, "Arrow stream", _UNWRITTEN), pa.OSFile(str(path)) as file, pa.ipc.open_stream(file) as stream:
        schema = stream.schema
        _ = schema.names  # raises for names that are no text
        rows = 0
        try:
            for batch in stream:
                batch.validate()
                rows += batch.num_rows
                _refuse_size(path, rows, len(schema))
                batches.append(batch)
        except InputError:
            raise
        except Exception as error:  # a damaged message raises many kinds
            problem = str(error).splitlines()[0] if str(error) else type(error).__name__
        table = pa.Table.from_batches(batches, schema)
    with path.open("rb") as raw:
        raw.seek(-min(8, path.stat().st_size), os.SEEK_END)
        closed = raw.read() == _STREAM_END
    return StreamRows(table, len(batches), problem, closed)


def numbers(path: Path, table: pa.Table, name: str) -> FloatArray:
    """A column of numbers (n,), NaN where a value is missing. Raises InputError for other values."""
    kind = table.schema.field(name).type
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
        raise InputError(f"{path}: {name}: given {kind} values, allowed numbers; convert the column")
    with parsing(path, f"column {name}"):
        return np.asarray(table.column(name).to_numpy().astype(np.float64))


def stored_unit(table: pa.Table, name: str) -> str | None:
    """The unit that a file gives with a column; None without one."""
    unit = (table.schema.field(name).metadata or {}).get(b"unit")
    return None if unit is None else unit.decode(errors="replace")


def stored_metadata(path: Path, table: pa.Table) -> dict[str, Any]:
    """Metadata of a recording. Raises InputError where they are no JSON mapping, or a key that is read has another type
    than it is written with."""
    with parsing(path, "recording: its metadata"):
        metadata = json.loads((table.schema.metadata or {}).get(METADATA_KEY, b"{}"))
        if not isinstance(metadata, dict):
            raise ValueError(f"given {type(metadata).__name__}, allowed a mapping")
        for key, (kind, of) in _KINDS.items():
            value = metadata.get(key)
            items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
            if value is not None and not (isinstance(value, kind) and all(isinstance(item, of) for item in items)):
                raise ValueError(f"{key}: given {value!r:.60}")
    return metadata


# type of a value, and of the items in it
_KINDS: dict[str, tuple[type | tuple[type, ...], type | tuple[type, ...]]] = {
    "period_s": ((int, float), ()),
    "lead_m": ((int, float), ()),
    "parts": (list, dict),
    "clock_notes": (list, str),
    "derived": (dict, str),
    "channels": (dict, dict),
    "unknown_columns": (list, str),
    "source": (str, ()),
}


def _refuse_size(path: Path, rows: int, columns: int) -> None:
    if rows * columns > MOST_VALUES:
        raise InputError(
            f"{path}: given {rows} rows of {columns} columns, allowed {MOST_VALUES} values together; "
            "cut the recording, or record fewer channels"
        )
