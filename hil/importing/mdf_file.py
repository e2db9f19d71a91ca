"""Read channels of an ASAM MDF 4 file (.mf4) with asammdf, an optional library."""

import logging
from contextlib import suppress
from pathlib import Path
from typing import Any

from hil.errors import InputError
from hil.files.input_file import MOST_BYTES, check_values, inflated, parsing


def load_mdf(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Channels of a file and their units, with the clock of each group: "time", of the groups after the first "time 2".

    Raises InputError: damaged, too many values, or asammdf is not installed.
    """
    try:
        from asammdf import MDF
        from asammdf.blocks.mdf_v4 import MDF4
    except ImportError:
        raise InputError(
            f"{path}: .mf4 files are read by asammdf, which is not installed; install it: pip install 'hil-servo[mf4]'"
        ) from None
    arrays, units = dict[str, Any](), dict[str, str]()
    check_mdf_size(path)
    MDF4.__del__ = _close
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)
    with parsing(path, "MDF 4 file"), MDF(path) as file:
        groups = [group for group in file.groups if group.channel_group.cycles_nr > 0]
        values = sum(group.channel_group.cycles_nr * len(group.channels) for group in groups)
        check_values(path, values, f"{values} values")
        for number, index in enumerate(file.virtual_groups, 1):
            clock = "time" if number == 1 else f"time {number}"
            for signal in file.select([(None, *place) for place in _places(file, index)], raw=False):
                arrays[clock] = signal.timestamps
                arrays[signal.name], units[signal.name] = signal.samples, signal.unit
            units[clock] = "s"
    return arrays, {name: unit for name, unit in units.items() if unit}


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
