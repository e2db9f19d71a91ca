"""Save what a page shows as a recording, which every command reads."""

from __future__ import annotations

import re
from pathlib import Path

from hil.errors import InputError
from hil.recording.recording import CLOCK_NOTES, PARTS, Recording, write_parquet
from hil.scope.rows import FixedRows

LEAST_ROWS = 50  # fewer are left out as a part without motion by the readers


def save(rows: FixedRows, folder: Path, name: str) -> Path:
    """Write rows as `folder`/`name`.parquet, or NAME_2 and so on where that is taken; returns the path.

    Metadata are those of the run, with `cut`: its first and last time [s]. Raises InputError: a name that is none, too
    few rows, a folder that cannot be written.
    """
    if not re.fullmatch(r"[\w][\w.-]{0,79}", name):
        raise InputError(f"name: given {name!r:.90}, allowed letters, digits, points, - and _, at most 80")
    time_s = rows.columns["time_s"]
    if len(time_s) < LEAST_ROWS:
        raise InputError(f"given {len(time_s)} rows, allowed {LEAST_ROWS} or more: choose a longer stretch")
    metadata = {key: value for key, value in rows.metadata.items() if key not in (PARTS, CLOCK_NOTES, "period_s")}
    metadata["cut"] = {"of": rows.name, "from_s": float(time_s[0]), "to_s": float(time_s[-1])}
    recording = Recording(name, rows.columns, rows.period_s, metadata)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}); start the scope with another --out") from None
    path, number = folder / f"{name}.parquet", 1
    while path.exists():
        number += 1
        path = folder / f"{name}_{number}.parquet"
    write_parquet(recording, path)
    return path
