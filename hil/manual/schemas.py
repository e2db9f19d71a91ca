"""JSON Schemas of bench, profile and map files, by which editors complete and check them."""

from __future__ import annotations

import json
from typing import Any

from hil.bench.control_section import UNKNOWN
from hil.manual.keys import FORMATS


def json_schema(kind: str) -> dict[str, Any]:
    """JSON Schema (2020-12) of a format of `FORMATS`; it allows what the program reads."""
    schema = FORMATS[kind].model_json_schema()
    if kind == "bench":
        _allow_short_forms(schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text(kind: str) -> str:
    """JSON Schema of a format, as `hil validate --schema` prints it."""
    return json.dumps(json_schema(kind), indent=1, ensure_ascii=False) + "\n"


def _allow_short_forms(schema: dict[str, Any]) -> None:
    """Allow keys of the axis at the top level, and a control law, or values of it, that are unknown."""
    definitions, own = schema["$defs"], schema["properties"]
    axes = [definitions[option["$ref"].rsplit("/", 1)[1]] for option in own["axis"]["oneOf"]]
    for axis in axes:
        for name, part in axis["properties"].items():
            own.setdefault(name, part)
    own["model"] = {"enum": [axis["properties"]["model"]["const"] for axis in axes], "description": "kind of axis"}
    schema["required"] = [name for name in schema["required"] if name != "axis"]
    schema["anyOf"] = [{"required": ["axis"]}, *({"required": axis["required"]} for axis in axes)]
    law = definitions["Control"]["properties"]
    law |= {name: {"anyOf": [part, {"const": UNKNOWN}]} for name, part in law.items() if name != "law"}
    own["control"]["oneOf"] += [{"const": UNKNOWN}, {"type": "null"}]
