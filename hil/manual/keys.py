"""Keys of a file format: section, unit, default, allowed values, meaning and an example of each, from its model.

Examples are values of complete, valid files: those of `examples/`, the shipped benches and the shipped maps.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from hil.bench.bench_file import Bench
from hil.files.shipped import shipped_files
from hil.files.yaml_model import load_model
from hil.importing.map_file import RecordingMap
from hil.motion.profile import Profile
from hil.quantities import unit_of

FORMATS: dict[str, type[BaseModel]] = {"bench": Bench, "profile": Profile, "map": RecordingMap}
EXAMPLES = Path(__file__).parent / "examples"  # FORMAT-NAME.yaml
_UNBOUNDED = 1e15  # a bound that only keeps numbers finite
BELOW = "see below"


@dataclass(frozen=True)
class Key:
    """One key of a section. `default` is "required" for one that must be given, empty for one that may be absent."""

    name: str
    unit: str
    default: str
    allowed: str
    example: str
    meaning: str


@dataclass(frozen=True)
class KeySection:
    """A mapping of a file: its place, such as `drive.encoder`, what distinguishes it from others there, its keys."""

    path: str
    kind: str
    about: str
    keys: tuple[Key, ...]


def sections(model: type[BaseModel]) -> list[KeySection]:
    """All sections of a format, from the top of the file downwards; one that stands at several places, at its first."""
    schema = model.model_json_schema()
    found = list[KeySection]()
    seen = set[str]()

    def visit(name: str, node: dict[str, Any], path: str) -> None:
        if name in seen:
            return
        seen.add(name)
        kind = next((f"{key}: {part['const']}" for key, part in node["properties"].items() if _names_kind(part)), "")
        required = node.get("required", ())
        parts = sorted(
            node["properties"].items(), key=lambda item: not _names_kind(item[1])
        )  # what tells the kind first
        keys = tuple(_key(name, key, part, key in required, schema) for key, part in parts)
        found.append(KeySection(path, kind, node.get("description", "").split("\n\n")[0].replace("\n", " "), keys))
        for key, part in node["properties"].items():
            for inner, step in _mappings(part, schema):
                visit(inner, schema["$defs"][inner], f"{path}.{key}{step}".lstrip("."))

    visit(model.__name__, schema, "")
    return found


def _names_kind(part: dict[str, Any]) -> bool:
    return isinstance(part.get("const"), str)


def _mappings(part: dict[str, Any], schema: dict[str, Any], step: str = "") -> Iterator[tuple[str, str]]:
    """Names of the sections that a value may hold, and how their place continues: `[]` in lists, `.NAME` by names."""
    if "$ref" in part:
        name = part["$ref"].rsplit("/", 1)[1]
        if "properties" in schema["$defs"][name]:
            yield name, step
    for option in (*part.get("anyOf", ()), *part.get("oneOf", ())):
        yield from _mappings(option, schema, step)
    if isinstance(part.get("items"), dict):
        yield from _mappings(part["items"], schema, f"{step}[]")
    if isinstance(part.get("additionalProperties"), dict):
        yield from _mappings(part["additionalProperties"], schema, f"{step}.NAME")


def _key(section: str, name: str, part: dict[str, Any], required: bool, schema: dict[str, Any]) -> Key:
    options = list(_plain(part, schema))
    meaning = next(
        (one["description"] for one in (part, *options) if "description" in one and "properties" not in one), ""
    )
    unit = re.search(r" ?\[([^\]]+)\]", meaning)
    number = any(one.get("type") in ("number", "integer") for one in options)
    default = "required" if required else "" if part.get("default") in (None, "", [], {}) else _text(part["default"])
    if _names_kind(part):
        meaning = "names this kind of section"
    nested = next(iter(_mappings(part, schema)), None)
    return Key(
        name,
        unit[1] if unit else unit_of(name) if number else "",
        BELOW if nested and default not in ("", "required") else default,
        _allowed(options),
        BELOW if nested else _examples().get((section, name), ""),
        meaning.replace(unit[0], "") if unit else meaning,
    )


def _plain(part: dict[str, Any], schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The alternatives of a value, and those of the items of a list, without null and names of definitions."""
    if "$ref" in part:
        yield from _plain(schema["$defs"][part["$ref"].rsplit("/", 1)[1]], schema)
    elif "anyOf" in part or "oneOf" in part:
        for option in (*part.get("anyOf", ()), *part.get("oneOf", ())):
            yield from _plain(option, schema)
    elif isinstance(part.get("items"), dict):
        yield from _plain(part["items"], schema)
    elif part.get("type") != "null":
        yield part


def _allowed(options: list[dict[str, Any]]) -> str:
    """Names or bounds of a value."""
    names = [_text(value) for one in options for value in one.get("enum", ())]
    if names:
        return ", ".join(name or '""' for name in names)
    numbers = next((one for one in options if one.get("type") in ("number", "integer")), {})
    low, high = numbers.get("minimum"), numbers.get("maximum", _UNBOUNDED)
    above, below = numbers.get("exclusiveMinimum"), numbers.get("exclusiveMaximum")
    lower = f"≥ {low:g}" if low is not None else f"> {above:g}" if above is not None else ""
    upper = f"≤ {high:g}" if high < _UNBOUNDED else f"< {below:g}" if below is not None else ""
    return ", ".join(bound for bound in (lower, upper) if bound)


@cache
def _examples() -> dict[tuple[str, str], str]:
    """(section, key) -> value as text, of the first file that gives it."""
    found: dict[tuple[str, str], str] = {}

    def collect(value: Any) -> None:
        if isinstance(value, BaseModel):
            for name in sorted(value.model_fields_set):
                given = getattr(value, name)
                collect(given)
                found.setdefault((type(value).__name__, name), _text(given))
        elif isinstance(value, dict):
            collect(tuple(value.values()))
        elif isinstance(value, tuple):
            for one in value:
                collect(one)

    for kind, path in example_files():
        collect(load_model(path, FORMATS[kind]))
    return found


def example_files() -> list[tuple[str, Path]]:
    """Format and path of every complete file from which examples are taken."""
    own = [(path.name.split("-")[0], path) for path in sorted(EXAMPLES.glob("*.yaml"))]
    shipped = [(kind, path) for kind in ("bench", "map") for path in shipped_files(kind).values()]
    return [*own, *shipped]


def _text(value: Any) -> str:
    """A value as a file would give it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_text(one)}" for key, one in value.items()) + "}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_text(one) for one in value) + "]"
    return str(value)
