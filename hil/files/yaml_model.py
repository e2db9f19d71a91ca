"""Load a YAML file into a pydantic model; every error names file, line and field.

    a.yaml:7: segments[0].stroke_m: given 'long', allowed a valid number (stroke [m]); correct the value

The dialect is the plain part of YAML 1.2: `1e-3` is a number, `on` and `2024-01-01` are text (PyYAML's
YAML 1.1 says otherwise), a key may stand once, and there are no anchors. Types are strict: "0.1" in
quotes is no number.
"""

import difflib
import json
import re
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from hil.errors import FieldError, FieldPath, InputError, field_name
from hil.files.input_file import bounded, check_file

Model = TypeVar("Model", bound=BaseModel)
SHOWN_ERRORS = 8  # more would scroll the first one away
MOST_BYTES = 200_000  # read in some seconds; ten times the longest profile


@bounded
def load_model(path: str | Path, model: type[Model]) -> Model:
    """Read `path` and validate it as `model`.

    Raises InputError: one line `file:line: field: given X, allowed Y; what to do` per finding.
    """
    path = Path(path)
    root, data = _read(path)
    try:
        # through JSON: strict types, and yet lists become tuples and text becomes enums
        return model.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        schema = model.model_json_schema()
        details = error.errors(include_url=False)
        # a list is called too short when its items are wrong: keep the innermost finding
        outer = {detail["loc"][:depth] for detail in details for depth in range(len(detail["loc"]))}
        inner = [detail for detail in details if detail["loc"] not in outer]
        shown = sorted(inner, key=lambda detail: _locate(root, detail["loc"])[0])[:SHOWN_ERRORS]
        findings = sorted(_finding(detail, root, schema) for detail in shown)
        lines = [f"{path}:{found.line}: {found.text}" for found in findings]
        if len(inner) > SHOWN_ERRORS:
            lines.append(f"{path}: and {len(inner) - SHOWN_ERRORS} more")
        raise InputError("\n".join(lines)) from None


def located(path: str | Path, error: FieldError) -> InputError:
    """An error found later in a file that could be read, with file and line in front."""
    line, _ = _locate(_read(Path(path))[0], error.field)
    return InputError(f"{path}:{line}: {error}")


class _Loader(yaml.SafeLoader):
    """SafeLoader with the core schema of YAML 1.2, without anchors and repeated keys."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  (PyYAML's own protocol)

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if getattr(event, "anchor", None) is not None:
            problem = f"given the anchor or alias {event.anchor!r}, allowed plain values; write the value out"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue  # refused by SafeLoader
            if key.value in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"{key.value}: given twice, allowed once; remove one", problem_mark=key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        # a tag such as !!bool or !!timestamp that the text does not fit, an integer of more than 4300 digits
        except (ValueError, LookupError, AttributeError, TypeError) as error:
            given = repr(f"{node.value:.40}") if isinstance(node, yaml.ScalarNode) else "several values"
            reason = f" ({str(error).split(';')[0]})" if isinstance(error, ValueError) else ""
            problem = f"given {given}, which is no {node.tag.rpartition(':')[2]}{reason}; correct the value"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark) from None


for _tag, _pattern, _first in (
    ("null", r"~|null|", ["~", "n", ""]),
    ("bool", r"true|false", list("tf")),
    ("int", r"[-+]?(0|[1-9][0-9]*|0x[0-9a-fA-F]+)", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+\.?[0-9]*)([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan", list("-+.0123456789")),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def yaml_text(path: Path) -> str:
    """The text of a YAML file. Raises InputError where it is no file, too large, or not UTF-8."""
    check_file(path, "the path of a YAML file", MOST_BYTES)
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a YAML file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not UTF-8; give a YAML text file") from None


def _read(path: Path) -> tuple[yaml.Node, Any]:
    """The node tree, which knows lines, and the plain data of a file."""
    text, loader = yaml_text(path), None
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None:
            raise InputError(f"{path}:1: given an empty file, allowed a mapping of keys; fill it in")
        return root, loader.construct_document(root)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{path}:{mark.line + 1}" if mark else str(path)
        raise InputError(f"{where}: {_sentence(error)}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{path}: not YAML text: {str(error).splitlines()[0]}; correct the file") from None
    except RecursionError:
        raise InputError(f"{path}: given hundreds of nested lists, allowed a few; correct the file") from None
    finally:
        if loader is not None:
            loader.dispose()


def _sentence(error: yaml.MarkedYAMLError) -> str:
    if ";" in (error.problem or ""):  # raised above, says what to do
        return str(error.problem)
    context = f" {error.context}" if error.context else ""
    return f"broken YAML{context}: {error.problem}; correct indentation, colons, brackets and quotes here"


class _Finding(NamedTuple):
    line: int
    text: str


def _finding(detail: ErrorDetails, root: yaml.Node, schema: dict[str, Any]) -> _Finding:
    kind, context, loc = detail["type"], detail.get("ctx", {}), detail["loc"]
    given = _shown(detail["input"])
    todo = "correct the value"
    message = None
    if kind == "value_error":
        cause = context["error"]
        message = str(cause)
        if isinstance(cause, FieldError):
            loc, message = loc + cause.field, cause.message
    elif kind in ("union_tag_invalid", "union_tag_not_found"):
        loc += (context["discriminator"].strip("'"),)
        given = repr(context["tag"]) if "tag" in context else "nothing"
        tags = [str(tag) for tag in _schema_at(schema, loc[:-1]).get("discriminator", {}).get("mapping", {})]
        allowed, todo = "one of " + ", ".join(tags), _closest(context.get("tag", ""), tags, "choose one")
    elif kind == "extra_forbidden":
        keys = list(_schema_at(schema, loc[:-1]).get("properties", {}))
        given, allowed = "an unknown key", "one of " + ", ".join(keys)
        todo = _closest(str(loc[-1]), keys, "remove it")
    elif kind == "missing" and isinstance(loc[-1], int):
        given, allowed, todo = f"a list of {loc[-1]}", "one more value", "add it"
    elif kind == "missing":
        given, allowed, todo = "nothing", "a value", "add this key"
    else:
        allowed = re.sub(r"^\w+ should (be )?", "", detail["msg"]).replace("an object", "a mapping of keys")
    line, field = _locate(root, loc)
    if message is None:
        meaning = _schema_at(schema, loc).get("description")
        message = f"given {given}, allowed {allowed}{f' ({meaning})' if meaning else ''}; {todo}"
    return _Finding(line, f"{field_name(field)}: {message}" if field else message)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "a mapping of keys"
    text = "a list" if isinstance(value, list) else "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _closest(word: str, choices: list[str], otherwise: str) -> str:
    close = difflib.get_close_matches(word, choices, n=1)
    return f"did you mean {close[0]}?" if close else otherwise


def _entries(node: yaml.MappingNode) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    """Key and value of a mapping by the text of the key, made once: a file may have thousands of unknown keys."""
    kept = vars(node)
    if "entries" not in kept:
        kept["entries"] = {key.value: (key, value) for key, value in node.value if isinstance(key, yaml.ScalarNode)}
    entries: dict[str, tuple[yaml.Node, yaml.Node]] = kept["entries"]
    return entries


def _locate(root: yaml.Node, loc: FieldPath) -> tuple[int, FieldPath]:
    """Line (from 1) and path in the file of a pydantic location, which also holds names of union members."""
    node, line, field = root, root.start_mark.line + 1, list[str | int]()
    for depth, part in enumerate(loc):
        if isinstance(node, yaml.MappingNode):
            entry = _entries(node).get(str(part))
            if entry is not None:
                line, node = entry[0].start_mark.line + 1, entry[1]
                field.append(part)
            elif depth == len(loc) - 1:  # a missing key: the line of the mapping it should stand in
                field.append(part)
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line + 1
            field.append(part)
    return line, tuple(field)


def _schema_at(schema: dict[str, Any], loc: FieldPath) -> dict[str, Any]:
    """The part of a JSON Schema that describes a pydantic location; {} where it cannot be told."""

    def resolved(part: dict[str, Any]) -> dict[str, Any]:
        while True:
            options = [option for option in part.get("anyOf", []) if option.get("type") != "null"]
            if "$ref" in part:
                part = {
                    **schema["$defs"][part["$ref"].rsplit("/", 1)[1]],
                    **{key: value for key, value in part.items() if key != "$ref"},
                }
            elif len(options) == 1:
                part = {**options[0], **{key: value for key, value in part.items() if key != "anyOf"}}
            else:
                return part

    here = resolved(schema)
    for part in loc:
        if "discriminator" in here:
            tagged = here["discriminator"]["mapping"].get(part)
            here = {"$ref": tagged} if tagged else {}
        elif isinstance(part, int):
            here = here.get("items", {})
        else:
            properties = here.get("properties", {})
            here = properties.get(part) or here.get("additionalProperties") or {}
        here = resolved(here) if isinstance(here, dict) else {}
    return here
