"""Read a file of records, JSON or XML, as columns."""

from pathlib import Path

from hil.files.input_file import parsing
from hil.files.json_columns import RecordColumns, read_json
from hil.files.xml_records import xml_columns


def read_records(path: Path) -> RecordColumns:
    """Read `path` by its ending. Raises InputError: damaged, too large, or no lists in it."""
    if path.suffix.lower() != ".xml":
        return read_json(path)
    with parsing(path, "XML file of records"):
        lists, units = xml_columns(path)
    return RecordColumns(lists, {}, units)
