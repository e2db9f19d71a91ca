"""Read channels of a National Instruments TDMS file with npTDMS, an optional library."""

from pathlib import Path
from typing import Any

import numpy as np

from hil.files.input_file import check_values, parsing
from hil.files.optional_library import optional_library
from hil.importing.channel_groups import CLOCK, Group, as_seconds, one_length


def load_tdms(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Scaled channels by name with their units, texts among the properties; the clock is that of the waveform.

    Channels of a group with another start, step or length than the first are a group of their own. Raises InputError:
    damaged, too many values, or npTDMS is not installed.
    """
    library = optional_library(path, "nptdms", "npTDMS", "exchange")
    with parsing(path, "TDMS file"), path.open("rb") as raw, library.TdmsFile.open(raw) as file:
        channels = [one for group in file.groups() for one in group.channels()]
        values = sum(len(one) for one in channels)
        check_values(path, values, f"channels of {values} values")
        texts = {
            str(key): np.array(text) for key, text in file.properties.items() if isinstance(text, str | int | float)
        }
        groups = dict[tuple[Any, ...], Group]()
        for one in channels:
            step_s = float(one.properties.get("wf_increment", 0.0) or 0.0)
            start_s = float(one.properties.get("wf_start_offset", 0.0) or 0.0)
            key = (one.group_name, step_s, start_s, len(one) if step_s else 0)
            if key not in groups:
                stamps = {CLOCK: start_s + step_s * np.arange(len(one))} if step_s > 0.0 else {}
                groups[key] = Group(one.group_name, stamps, {CLOCK: "s"} if stamps else {}, has_clock=bool(stamps))
            values_read = one[:]
            dated = values_read.dtype.kind == "M"
            groups[key].channels[one.name] = as_seconds(values_read) if dated else values_read
            unit = str(one.properties.get("unit_string", ""))
            groups[key].units[one.name] = "s" if dated else unit
    arrays, units = one_length(path, groups.values())
    return texts | arrays, units
