"""Parquet files and Arrow streams that may be damaged or of any size, read into bounded memory.

A few bytes of a compressed column stand for any number of equal values: the size in memory is known before reading from
the number of rows, not from the size of the file.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.input_file import check_file, check_values, parsing

METADATA_KEY = b"hil"  # of the schema: the metadata as JSON
_LONGEST_TEXT = 100  # characters of a stored text that may be a constant or a unit
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


def parquet_schema(path: Path) -> pa.Schema:
    """Names and types of the columns of a Parquet file. Raises InputError: damaged."""
    check_file(path, FORMATS)
    with parsing(path, "Parquet file", _DAMAGED), pq.ParquetFile(path, memory_map=True) as file:
        return file.schema_arrow


def is_number(kind: pa.DataType) -> bool:
    """True for a type of numbers."""
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind))


def read_parquet(path: Path, wanted: Collection[str]) -> pa.Table:
    """Columns of a Parquet file: numbers, times, or texts, which come as a dictionary.

    Raises InputError: damaged, a column missing or of another type, too many values.
    """
    schema = parquet_schema(path)
    texts = []
    for name in wanted:
        if name not in schema.names:
            raise InputError(f"{path}: column {name!r} is missing; the file has {listed(schema.names)}")
        with parsing(path, "Parquet file", _DAMAGED):
            kind = schema.field(name).type
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            texts.append(name)
        elif not (is_number(kind) or pa.types.is_timestamp(kind)):
            raise _other_type(path, name, kind)
    with parsing(path, "Parquet file", _DAMAGED):
        # a text of any length takes a few bytes in each further row; it must do so in memory
        with pq.ParquetFile(path, memory_map=True, read_dictionary=texts) as file:
            rows = file.metadata.num_rows
            check_values(path, rows * len(wanted), f"{rows} rows of {len(wanted)} columns")
            table = file.read(list(wanted), use_threads=False)
        table.validate()
        if table.num_rows != rows:
            raise ValueError(f"{table.num_rows} rows of {rows}")
    return table


def read_stream(path: Path) -> StreamRows:
    """The complete batches of an Arrow stream, closed or not. Raises InputError: no stream, or too many values."""
    check_file(path, FORMATS)
    batches, problem = [], ""
    with parsing(path, "Arrow stream", _UNWRITTEN), pa.OSFile(str(path)) as file:
        messages = pa.ipc.MessageReader.open_stream(file)
        schema = pa.ipc.read_schema(messages.read_next_message())
        _ = schema.names  # raises for names that are no text
        rows = 0
        try:
            for message in messages:
                if _compressed(message.metadata.to_pybytes()):  # a few bytes may stand for gigabytes
                    raise InputError(
                        f"{path}: holds compressed blocks, allowed plain ones as a run writes them; "
                        "convert it to Parquet"
                    )
                batch = pa.ipc.read_record_batch(message, schema)
                batch.validate()
                rows += batch.num_rows
                check_values(path, rows * len(schema), f"{rows} rows of {len(schema)} columns")
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


def _compressed(message: bytes) -> bool:
    """True for a record batch with the field BodyCompression (Arrow columnar format, Message.fbs; FlatBuffers)."""

    def field(table: int, number: int) -> int | None:
        """Place of a field of the table at `table`; None if it has its default."""
        offsets = table - struct.unpack_from("<i", message, table)[0]
        if 4 + 2 * number >= struct.unpack_from("<H", message, offsets)[0]:
            return None
        offset = struct.unpack_from("<H", message, offsets + 4 + 2 * number)[0]
        return table + offset if offset else None

    header = field(struct.unpack_from("<I", message)[0], 2)
    return header is not None and field(header + struct.unpack_from("<I", message, header)[0], 3) is not None


def numbers(path: Path, table: pa.Table, name: str) -> FloatArray:
    """A column of numbers (n,), NaN where a value is missing. Raises InputError for other values."""
    kind = table.schema.field(name).type
    if not is_number(kind):
        raise _other_type(path, name, kind)
    with parsing(path, f"column {name}"):
        return np.asarray(table.column(name).to_numpy().astype(np.float64))


def _other_type(path: Path, name: str, kind: pa.DataType) -> InputError:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return InputError(f"{path}: {name}: given {kind} values, allowed numbers; convert the column")


def stored_unit(schema: pa.Schema, name: str) -> str | None:
    """The unit that a file gives with a column; None without one."""
    unit = (schema.field(name).metadata or {}).get(b"unit")
    return None if unit is None else unit.decode(errors="replace")


def stored_values(schema: pa.Schema) -> dict[str, float | str]:
    """Numbers and texts that other programs than this store with a table, by name; those of pandas are its attrs."""
    found: dict[str, Any] = {}
    for key, stored in (schema.metadata or {}).items():
        text = stored.decode(errors="replace")
        if key == b"PANDAS_ATTRS":
            with suppress(ValueError):  # no JSON, no mapping
                found |= dict(json.loads(text))
        elif len(text) <= _LONGEST_TEXT:
            found[key.decode(errors="replace")] = text
    values: dict[str, float | str] = {}
    for name, value in found.items():
        try:
            values[name] = float(value)
        except (ValueError, TypeError):
            values[name] = str(value)
    return values


def stored_metadata(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """Metadata of a recording in the schema of its file. Raises InputError as `checked_metadata`."""
    return checked_metadata(path, (schema.metadata or {}).get(METADATA_KEY, b"{}"))


def checked_metadata(path: Path, text: str | bytes) -> dict[str, Any]:
    """Metadata of a recording. Raises InputError where they are no JSON mapping, or a key that is read has another type
    than it is written with."""
    with parsing(path, "recording: its metadata"):
        metadata = json.loads(text)
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
