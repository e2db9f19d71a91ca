"""Write an MCAP file with mcap: one topic, whose messages of JSON are the rows, and a record of metadata."""

import json
from pathlib import Path

from hil.channels import CHANNELS
from hil.exchange.content import METADATA, Content
from hil.files.optional_library import optional_library

TOPIC = "hil"


def write_mcap(path: Path, content: Content) -> None:
    """Write a message per row, at its instant; units and meanings stand in the JSON schema of the topic."""
    library = optional_library(path, "mcap.writer", "mcap", "exchange")
    fields = {
        name: {"type": "number", "title": f"{name} [{CHANNELS[name].unit}]", "description": CHANNELS[name].meaning}
        for name in content.columns
    }
    schema = {"type": "object", "title": "hil.row", "properties": fields, "required": list(fields)}
    start_ns = round(content.start.timestamp()) * 1_000_000_000
    names, columns = list(content.columns), [values.tolist() for values in content.columns.values()]
    with path.open("wb") as file:
        writer = library.Writer(file)
        writer.start(profile="", library="hil-servo")
        writer.add_metadata(METADATA, {METADATA: content.metadata})
        schema_id = writer.register_schema("hil.row", "jsonschema", json.dumps(schema).encode())
        channel = writer.register_channel(TOPIC, "json", schema_id)
        for sequence, row in enumerate(zip(*columns, strict=True)):
            at_ns = max(start_ns + round(row[0] * 1e9), 0)
            data = json.dumps(dict(zip(names, row, strict=True))).encode()
            writer.add_message(channel, at_ns, data, at_ns, sequence)
        writer.finish()
