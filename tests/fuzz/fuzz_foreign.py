"""Fuzz target of foreign recordings: each dialect and format of the import, damaged, drafted and imported."""

from __future__ import annotations

import functools
import importlib.util
import random
import tempfile
from pathlib import Path

from channel_files import LIBRARIES
from dialects import DIALECTS
from foreign_axis import axis, renamed, write
from mutations import damaged_bytes, damaged_text

from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text

ROWS = 300
_TEXTS = ("csv", "txt", "log")


@functools.cache
def _files() -> tuple[tuple[str, bytes], ...]:
    """Ending and content of each kind of file, texts cut to a few rows."""
    found = []
    small = renamed(axis(rows=ROWS), t="time_s", angle="motor_angle_rad", torque="torque_Nm", x_set="setpoint_mm")
    with tempfile.TemporaryDirectory() as name:
        for ending, make in DIALECTS.values():
            if ending in LIBRARIES and importlib.util.find_spec(LIBRARIES[ending]) is None:
                continue
            path = Path(name) / f"a.{ending}"
            make(path)
            data = path.read_bytes()
            found.append((ending, b"".join(data.splitlines(keepends=True)[:ROWS]) if ending in _TEXTS else data))
        for ending in ("mat", "parquet", "json"):
            found.append((ending, write(Path(name) / f"small.{ending}", small).read_bytes()))
    return tuple(found)


def foreign(rng: random.Random, folder: Path) -> None:
    """Foreign recording: drafted, and imported by its draft."""
    ending, data = rng.choice(_files())
    path, map_path = folder / f"foreign.{ending}", folder / "map.yaml"
    text = ending in (*_TEXTS, "json", "jsonl", "xml") and rng.random() < 0.7
    path.write_bytes(damaged_text(rng, data.decode()) if text else damaged_bytes(rng, data))
    map_path.write_text(map_text(draft_map(path, rng.choice((None, 1000.0)))))
    import_recording(path, map_path)
