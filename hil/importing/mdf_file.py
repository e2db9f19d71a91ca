"""Read channels of an ASAM MDF 4 file (.mf4) with asammdf, an optional library."""

import logging
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hil.files.input_file import MOST_BYTES, check_values, inflated, parsing
from hil.files.optional_library import optional_library
from hil.importing.channel_groups import CLOCK, Group, one_length


def load_mdf(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Channels of a file and their units, as `one_length` gives them; attachments of JSON as texts.

    Raises InputError: damaged, too many values, or asammdf is not installed.
    """
    library = optional_library(path, "asammdf", "asammdf", "mf4")
    blocks = optional_library(path, "asammdf.blocks.mdf_v4", "asammdf", "mf4")
    check_mdf_size(path)
    blocks.MDF4.__del__ = _close
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    with parsing(path, "MDF 4 file"), library.MDF(path) as file:
        groups = [group for group in file.groups if group.channel_group.cycles_nr > 0]
        values = sum(group.channel_group.cycles_nr * len(group.channels) for group in groups)
        check_values(path, values, f"{values} values")
        read = [_group(file, number, index) for number, index in enumerate(file.virtual_groups, 1)]
        texts = {
            Path(one.file_name).stem: np.array(bytes(file.extract_attachment(index=index)[0]).decode())
            for index, one in enumerate(file.attachments)
            if one.mime == "application/json"
        }
    arrays, units = one_length(path, read)
    return arrays | texts, units


def _group(file: Any, number: int, index: int) -> Group:
    """A virtual group, its scaled values with NaN where a sample is marked as invalid."""
    channels, units = dict[str, Any](), {CLOCK: "s"}
    for signal in file.select([(None, *place) for place in _places(file, index)], raw=False):
        channels.setdefault(CLOCK, signal.timestamps)
        values = signal.samples
        own = signal.name if signal.name not in channels else f"{signal.name} {len(channels)}"
        if signal.invalidation_bits is not None and values.dtype.kind in "fiub":
            values = np.where(np.asarray(signal.invalidation_bits, dtype=bool), np.nan, values.astype(np.float64))
        channels[own], units[own] = values, signal.unit
    return Group(file.groups[index].channel_group.acq_name or f"group {number}", channels, units)


def _close(file: Any) -> None:
    """Close a file; the destructor of asammdf prints an error where it could not be opened."""
    with suppress(AttributeError):
        file.close()


def check_mdf_size(path: Path) -> None:
    """Refuse compressed blocks that expand to too many bytes. Raises InputError.

    Layout of a block ##DZ (ASAM MDF 4.1): head of 24 bytes, types and parameter of 8, two sizes of 8, zlib stream.
    """
    content, expanded = path.read_bytes(), 0
    at = content.find(b"##DZ")
    while at >= 0:
        size = int.from_bytes(content[at + 40 : at + 48], "little")
        expanded += len(inflated(content[at + 48 : at + 48 + size], MOST_BYTES - expanded + 1))
        check_values(path, -(-expanded // 8), f"{len(content)} bytes that expand to more than {MOST_BYTES}")
        at = content.find(b"##DZ", at + 4)


def _places(file: Any, index: int) -> list[tuple[int, int]]:
    """Group and number of each channel of a virtual group, but for its clock."""
    chosen = file.included_channels(index)[index]
    return [(group, channel) for group, channels in chosen.items() for channel in channels]
