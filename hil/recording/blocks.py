"""The Arrow stream of a run, written so that its parts can be checked and found without Arrow.

    head: schema message, metadata of the run      block: record batch message | columns, each (n,) float64, one by one

A block carries the number of its first row, its rows and a checksum as text in its message (`hil-block`), the head its
channels and a checksum of them and of the metadata (`hil-head`). Any reader of Arrow streams reads such a file (Arrow
columnar format, "Encapsulated message format"). But decoding a damaged message may exhaust the memory or end the
process: `whole_blocks` and `read_head` use nothing whose checksum is wrong, and decode no message at all.
"""

from __future__ import annotations

import io
import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from hil.arrays import FloatArray
from hil.recording.recording import METADATA_KEY

_MARK = b"\xff\xff\xff\xff"  # begins each message; its length follows, 0 at the end of the stream
STREAM_END = _MARK + bytes(4)
_BLOCK = re.compile(rb"hil-block (\d{12} \d{8}) ([0-9a-f]{8})")
_HEAD = re.compile(rb"hil-head (\d{8}) (\d{8}) ([0-9a-f]{8}) ")
_MOST_BYTES = 1 << 16  # of the message of a block: some 60 for each column


class StreamBlock(NamedTuple):
    """Rows (n, columns) of a block, the number of the first, and its place in the file [bytes]."""

    rows: FloatArray
    first: int
    start: int
    end: int


class StreamHead(NamedTuple):
    """Channels, metadata as JSON (None: damaged), and end of the head [bytes]."""

    channels: tuple[str, ...]
    metadata: bytes | None
    end: int


def encode(rows: FloatArray, first: int, schema: pa.Schema) -> bytes:
    """Return rows (n, columns), the first of which has the number `first`, as a block. schema: without metadata."""
    columns = np.ascontiguousarray(rows.T, dtype=np.float64)
    batch = pa.RecordBatch.from_arrays([pa.array(column) for column in columns], schema=schema)
    numbers = f"{first:012d} {len(rows):08d}"
    checksum = zlib.crc32(columns.data.cast("B"), zlib.crc32(numbers.encode()))
    sink = io.BytesIO()
    with pa.ipc.new_stream(sink, schema) as stream:
        stream.write_batch(batch, custom_metadata={"": f"hil-block {numbers} {checksum:08x}"})
    return sink.getvalue()[schema.serialize().size : -len(STREAM_END)]


def encode_head(schema: pa.Schema) -> bytes:
    """Return the head of a stream with this schema, its metadata included."""
    names, metadata = ",".join(schema.names).encode(), schema.metadata[METADATA_KEY]
    checksum = zlib.crc32(metadata, zlib.crc32(names))
    text = f"hil-head {len(names):08d} {len(metadata):08d} {checksum:08x} ".encode() + names
    data: bytes = schema.with_metadata({**schema.metadata, b"": text}).serialize().to_pybytes()
    return data


def read_head(data: bytes | mmap.mmap) -> StreamHead | None:
    """Read the head of a stream; None if it does not tell its channels."""
    size = struct.unpack("<i", data[4:8])[0] if data[:4] == _MARK and len(data) >= 8 else -1
    text = data[: 8 + size] if 0 < size <= len(data) - 8 else b""
    found = _HEAD.search(text)
    if found is None:
        return None
    names = text[found.end() : found.end() + int(found[1])]
    length = int(found[2])
    place, metadata = -1, None
    while (place := text.find(struct.pack("<I", length), place + 1)) >= 0:  # a text follows its length
        given = text[place + 4 : place + 4 + length]
        if zlib.crc32(given, zlib.crc32(names)) == int(found[3], 16):
            metadata = given
            break
    return StreamHead(tuple(names.decode(errors="replace").split(",")), metadata, 8 + size)


def block_at(data: bytes | mmap.mmap, start: int, columns: int) -> StreamBlock | None:
    """Return the block that begins at `start` of a stream, None if there is no whole one."""
    if data[start : start + 4] != _MARK or len(data) < start + 8:
        return None
    size = struct.unpack("<i", data[start + 4 : start + 8])[0]
    found = _BLOCK.search(data[start + 8 : start + 8 + size]) if 0 < size <= _MOST_BYTES else None
    if found is None:
        return None
    first, count = map(int, found[1].split())
    end = start + 8 + size + 8 * count * columns
    values = data[start + 8 + size : end]
    if end > len(data) or zlib.crc32(values, zlib.crc32(found[1])) != int(found[2], 16):
        return None
    return StreamBlock(np.frombuffer(values, np.float64).reshape(columns, count).T, first, start, end)


def whole_blocks(data: bytes | mmap.mmap, start: int, columns: int) -> Iterator[StreamBlock]:
    """Yield the whole blocks of a stream from `start` on; what stands between them is damaged and left out."""
    while start >= 0:
        block = block_at(data, start, columns)
        if block is None:
            start = data.find(_MARK, start + 1)
        else:
            yield block
            start = block.end
