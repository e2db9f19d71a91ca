"""Read topics of an MCAP file with mcap, an optional library: messages of JSON, and those of ROS 2 (CDR)."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import InputError, listed
from hil.files.input_file import MOST_BYTES, check_values, parsing
from hil.files.optional_library import optional_library
from hil.importing.channel_groups import CLOCK, Group, one_length

_ENCODINGS = ("json", "cdr")
_DAMAGED = "it is cut or damaged: the program `mcap recover` saves what is whole"
_LONGEST_LIST = 16  # items of a list in a message: a longer one is no channel of an axis
_DEPTH = 8  # of values within values


def load_mcap(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Fields of the messages of each topic, by the time of its log [s], and texts of its metadata records.

    The stamp of a ROS header takes the place of the time of the log. Raises InputError: damaged, too many values,
    messages in none of the encodings, a library that is not installed.
    """
    library = optional_library(path, "mcap.records", "mcap", "exchange")
    schemas, channels, texts = dict[int, Any](), dict[int, Any](), dict[str, Any]()
    topics, others = dict[int, _Topic](), set[str]()
    values = 0
    with parsing(path, "MCAP file", _DAMAGED):
        for record in _records(path):
            if isinstance(record, library.Schema):
                schemas[record.id] = record
            elif isinstance(record, library.Channel):
                channels[record.id] = record
            elif isinstance(record, library.Metadata):
                texts |= {key: np.array(text) for key, text in record.metadata.items()}
            elif isinstance(record, library.Message):
                channel = channels[record.channel_id]
                if channel.message_encoding not in _ENCODINGS:
                    others.add(channel.message_encoding)
                    continue
                topic = topics.get(channel.id)
                if topic is None:
                    decode = _decoder(path, channel, schemas.get(channel.schema_id))
                    topic = topics[channel.id] = _Topic(channel.topic, decode)
                values += topic.add(record)
                check_values(path, values, f"more than {values} values")
    if not topics and others:
        raise InputError(
            f"{path}: its messages are of the encoding {listed(sorted(others))}, allowed {', '.join(_ENCODINGS)}; "
            "export the topics of the axis to CSV"
        )
    first_ns = min((topic.stamps_ns[0] for topic in topics.values()), default=0)
    arrays, units = one_length(path, [topic.group(first_ns) for topic in topics.values()])
    return arrays | texts, units


class _Topic:
    """Numbers of the messages of one topic by field, NaN where a message lacks a field."""

    def __init__(self, name: str, decode: Callable[[bytes], Any]) -> None:
        self._name, self._decode = name.strip("/").replace("/", "."), decode
        self.stamps_ns: list[int] = []
        self._fields: dict[str, list[float]] = {}

    def add(self, message: Any) -> int:
        """Take a message; return how many values it has."""
        found = dict[str, float]()
        _flatten("", self._decode(message.data), found, _DEPTH)
        stamp_ns = _header_ns(found)
        rows = len(self.stamps_ns)
        self.stamps_ns.append(message.log_time if stamp_ns is None else stamp_ns)
        for name, value in found.items():
            column = self._fields.setdefault(name, [])
            column += [math.nan] * (rows - len(column))
            column.append(value)
        return len(found) + 1

    def group(self, first_ns: int) -> Group:
        """The channels of the topic; stamps since `first_ns`."""
        rows = len(self.stamps_ns)
        padded = {name: [*values, *[math.nan] * (rows - len(values))] for name, values in self._fields.items()}
        columns = {name: np.array(values, dtype=np.float64) for name, values in padded.items()}
        stamps = np.array([stamp - first_ns for stamp in self.stamps_ns], dtype=np.int64) * 1e-9
        return Group(self._name, {CLOCK: stamps} | columns, {CLOCK: "s"})


def _records(path: Path) -> Iterator[Any]:
    """Records of a file, also those within chunks. Raises InputError for chunks that expand to too many bytes."""
    library = optional_library(path, "mcap.stream_reader", "mcap", "exchange")
    expanded = 0
    with path.open("rb") as file:
        for record in library.StreamReader(file, emit_chunks=True, record_size_limit=MOST_BYTES).records:
            if type(record).__name__ != "Chunk":
                yield record
                continue
            expanded += max(_expanded(record, MOST_BYTES - expanded), record.uncompressed_size)
            check_values(path, -(-expanded // 8), f"chunks that expand to more than {MOST_BYTES} bytes")
            yield from library.breakup_chunk(record, validate_crc=True)


def _expanded(chunk: Any, most: int) -> int:
    """Bytes that a chunk expands to, `most` + 1 where they are more; what its record says need not be true."""
    if chunk.compression == "lz4":
        import lz4.frame

        return len(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=most + 1))
    if chunk.compression == "zstd":
        import zstandard

        return int(zstandard.frame_content_size(chunk.data))
    return len(chunk.data)


def _decoder(path: Path, channel: Any, schema: Any) -> Callable[[bytes], Any]:
    if channel.message_encoding == "json":
        return json.loads
    factory = optional_library(path, "mcap_ros2.decoder", "mcap-ros2-support", "exchange").DecoderFactory()
    decode: Callable[[bytes], Any] | None = factory.decoder_for(channel.message_encoding, schema)
    if decode is None:
        raise InputError(f"{path}: {channel.topic}: its messages have no definition of ROS 2; export it to CSV")
    return decode


def _flatten(name: str, value: Any, into: dict[str, float], depth: int) -> None:
    """Put the numbers of a message into `into`, by the path of their fields; texts and long lists are left out."""
    if isinstance(value, bool | int | float):
        into[name] = float(value)
    elif depth and isinstance(value, dict):
        for key, item in value.items():
            _flatten(f"{name}.{key}" if name else str(key), item, into, depth - 1)
    elif depth and hasattr(value, "__slots__"):  # a message of ROS
        for key in value.__slots__:
            _flatten(f"{name}.{key}" if name else str(key), getattr(value, key), into, depth - 1)
    elif depth and isinstance(value, list | tuple | np.ndarray) and len(value) <= _LONGEST_LIST:
        for index, item in enumerate(value):
            item = item.item() if isinstance(item, np.generic) else item
            _flatten(f"{name}[{index}]", item, into, depth - 1)


def _header_ns(found: dict[str, float]) -> int | None:
    """Time of a ROS header, which is taken out of `found`; None without one."""
    seconds = found.pop("header.stamp.sec", None)
    fraction = found.pop("header.stamp.nanosec", None)
    if seconds is None or fraction is None or not seconds:
        return None
    return int(seconds) * 1_000_000_000 + int(fraction)
