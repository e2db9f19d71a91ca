"""Read one recording of a fleet, and tell its moment."""

import re
from datetime import UTC, datetime
from pathlib import Path

from hil.errors import InputError
from hil.files.input_file import is_file
from hil.recording.recording import Recording, read_recording

BENCH, MAP, SERVICE = "bench.yaml", "map.yaml", "service.csv"  # within the folder of an axis
_DATE = re.compile(
    r"(?<!\d)(?P<y>(?:19|20)\d{2})[-_.]?(?P<m>0[1-9]|1[0-2])[-_.]?(?P<d>0[1-9]|[12]\d|3[01])"
    r"(?:[T_ -]?(?P<h>[01]\d|2[0-3])[-_.:h]?(?P<min>[0-5]\d)(?:[-_.:m]?(?P<s>[0-5]\d))?)?(?!\d)"
)


def is_recording(file: str) -> bool:
    """False for what lies beside recordings: benches, maps, services, notes."""
    path = Path(file)
    return path.name != SERVICE and path.suffix.lower() not in (".yaml", ".yml", ".md", ".html", ".eds", ".dcf")


def read(path: Path, map_path: Path | None) -> Recording:
    """Read a recording of this project, or any other file by the map of its axis; of several parts the longest.

    Raises InputError for a file that is empty, cut, or no recording.
    """
    from hil.exchange.own_file import read_exported  # late: it asks for kernels, whose folder a worker has to set first
    from hil.importing.by_map import import_recording

    if is_file(path) and not path.stat().st_size:
        raise InputError(f"{path.name}: the file is empty")
    if map_path is not None and is_file(map_path):
        recording = import_recording(path, map_path)
    else:
        exported = read_exported(path)
        recording = read_recording(path) if exported is None else exported
    return max(recording.parts(), key=len)


def moment_of(recording: Recording, file: str) -> datetime:
    """When a recording was made, by its metadata or by a date in its name, UTC. Raises InputError if neither tells."""
    told = recording.metadata.get("start_time", "")
    try:
        moment = datetime.fromisoformat(told)
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except (ValueError, TypeError):
        pass
    if match := _DATE.search(Path(file).stem):
        year, month, day, hour, minute, second = (int(match[name] or 0) for name in ("y", "m", "d", "h", "min", "s"))
        try:
            return datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:
            pass
    raise InputError(
        f"{file}: its moment is not known: no start_time in its metadata, no date in its name; name it with one, as "
        "2025-03-01T0600.csv"
    )
