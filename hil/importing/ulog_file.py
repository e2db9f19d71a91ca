"""Read topics of a ULog file (.ulg, PX4) with pyulog, an optional library."""

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from hil.files.input_file import check_values, parsing
from hil.files.optional_library import optional_library
from hil.importing.channel_groups import CLOCK, Group, one_length

_STAMP = "timestamp"  # field of every topic [us]


def load_ulog(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Fields of each topic with the stamps of the topic [s]; a ULog file has no units.

    Raises InputError: damaged, too many values, or pyulog is not installed.
    """
    library = optional_library(path, "pyulog", "pyulog", "exchange")
    # it prints what is damaged
    with parsing(path, "ULog file"), path.open("rb") as raw, redirect_stdout(sys.stderr):
        topics = library.ULog(raw, disable_str_exceptions=True).data_list
        values = sum(one.data[_STAMP].size * len(one.data) for one in topics)
        check_values(path, values, f"topics of {values} values")
        start = min((one.data[_STAMP][0] for one in topics if one.data[_STAMP].size), default=0)
        groups = []
        for one in topics:
            fields = {name: values for name, values in one.data.items() if name != _STAMP}
            stamps = {CLOCK: (one.data[_STAMP] - start) * 1e-6}
            name = one.name if one.multi_id == 0 else f"{one.name}.{one.multi_id}"
            groups.append(Group(name, stamps | fields, {CLOCK: "s"}))
    return one_length(path, groups)
