"""Write and read CSV with plain rows, its units and metadata in FILE-metadata.json beside it.

The second file follows the W3C recommendation "Metadata Vocabulary for Tabular Data" (CSVW, 2015): programs that do not
know it read the rows alone, whose names hold the units.
"""

import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv as pacsv

from hil.arrays import FloatArray
from hil.channels import CHANNELS
from hil.exchange.content import METADATA, Content
from hil.files import csv_columns
from hil.files.input_file import check_file, is_file, parsing
from hil.files.output import write_text


def metadata_path(path: Path) -> Path:
    """Place of the metadata of a CSV file."""
    return path.with_name(f"{path.name}-metadata.json")


def write_csv(path: Path, content: Content) -> None:
    """Write the rows with every digit of a number."""
    pacsv.write_csv(pa.table(content.columns), path, pacsv.WriteOptions(quoting_style="none"))


def write_csv_metadata(path: Path, content: Content) -> None:
    """Write the metadata of a CSV file beside it."""
    columns = [
        {
            "name": name,
            "titles": name,
            "datatype": "double",
            "schema:unitText": CHANNELS[name].unit,
            "dc:description": CHANNELS[name].meaning,
        }
        for name in content.columns
    ]
    told = {
        "@context": "http://www.w3.org/ns/csvw",
        "url": path.name,
        "tableSchema": {"columns": columns},
        "notes": [{METADATA: content.metadata}],
    }
    write_text(metadata_path(path), json.dumps(told, indent=1))


def read_csv(path: Path) -> tuple[dict[str, FloatArray], dict[str, str], str] | None:
    """Columns, units and metadata of an exported file; None for one without its metadata. Raises InputError."""
    beside = metadata_path(path)
    if not is_file(beside):
        return None
    check_file(beside, "the metadata that were written with the CSV file")
    with parsing(beside, "CSVW metadata"):
        told: dict[str, Any] = json.loads(beside.read_text(encoding="utf-8"))
        text = next((note[METADATA] for note in told.get("notes", ()) if METADATA in note), None)
        if text is None:
            return None
        units = {one["name"]: str(one.get("schema:unitText", "")) for one in told["tableSchema"]["columns"]}
    names = csv_columns.read_header(path)
    return csv_columns.read_columns(path, [name for name in names if name in CHANNELS]), units, str(text)
