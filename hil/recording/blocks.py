"""Blocks of an Arrow stream that stand for themselves: each knows its length, its first row and a checksum of its rows.

A block is one record batch of the stream (Arrow columnar format, "Encapsulated message format") with the custom
metadata `row`, the number of its first row since the begin of the run, and `crc32` of its rows as float64, row after
row. Any reader of Arrow streams reads them; `whole_blocks` also finds those behind a damaged place.
"""

from __future__ import annotations

import io
import mmap
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from hil.arrays import FloatArray

_MARK = b"\xff\xff\xff\xff"  # begins each message; its length follows, 0 at the end of the stream
STREAM_END = _MARK + bytes(4)

_DAMAGED = (pa.ArrowException, OSError, ValueError, EOFError)  # what pyarrow raises at bytes that are no message


class StreamBlock(NamedTuple):
    """Rows (n, columns) of a block, the number of the first (None: not told), and its place in the file [bytes]."""

    rows: FloatArray
    first: int | None
    start: int
    end: int


def encode(rows: FloatArray, first: int, schema: pa.Schema) -> bytes:
    """Return rows (n, columns), the first of which has the number `first`, as a block."""
    batch = pa.RecordBatch.from_arrays([pa.array(column) for column in np.ascontiguousarray(rows.T)], schema=schema)
    sink = io.BytesIO()
    with pa.ipc.new_stream(sink, schema) as stream:
        stream.write_batch(batch, custom_metadata={"row": str(first), "crc32": str(_checksum(rows))})
    return sink.getvalue()[schema.serialize().size : -len(STREAM_END)]


def read_schema(data: bytes | mmap.mmap) -> tuple[pa.Schema, int] | None:
    """Return the schema with which a stream begins, and where its blocks begin; None if it is damaged."""
    try:
        message = pa.ipc.read_message(pa.py_buffer(data))
        schema = pa.ipc.read_schema(message)
        return schema, 8 + message.metadata.size
    except _DAMAGED:
        return None


def block_at(data: memoryview, start: int, schema: pa.Schema) -> StreamBlock | None:
    """Return the block that begins at `start` of a stream, None if there is no whole one."""
    head = bytes(data[start : start + 8])
    if len(head) < 8 or head[:4] != _MARK or not 0 < struct.unpack("<i", head[4:])[0] <= len(data) - start - 8:
        return None
    bare = schema.remove_metadata()
    try:
        message = pa.ipc.read_message(pa.py_buffer(data[start:]))
        if message.type != "record batch":
            return None
        end = start + 8 + message.metadata.size + message.body.size
        stream = pa.ipc.open_stream(pa.BufferReader(bare.serialize().to_pybytes() + bytes(data[start:end])))
        batch, about = stream.read_next_batch_with_custom_metadata()
        batch.validate(full=True)
        rows = np.column_stack([column.to_numpy() for column in batch.columns])
        told = dict(about or {})
        if b"crc32" in told and int(told[b"crc32"]) != _checksum(rows):
            return None
        return StreamBlock(rows, int(told[b"row"]) if b"row" in told else None, start, end)
    except _DAMAGED:
        return None


def whole_blocks(data: bytes | mmap.mmap, start: int, schema: pa.Schema) -> Iterator[StreamBlock]:
    """Yield the whole blocks of a stream from `start` on; what stands between them is damaged and left out."""
    while start >= 0:
        block = block_at(memoryview(data), start, schema)
        if block is None:
            start = data.find(_MARK, start + 1)
        else:
            yield block
            start = block.end


def _checksum(rows: FloatArray) -> int:
    return zlib.crc32(np.ascontiguousarray(rows, dtype=np.float64).data.cast("B")) if rows.size else 0
