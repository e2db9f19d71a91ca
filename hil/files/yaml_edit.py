"""Change values in the text of a YAML file and keep the rest as its owner wrote it: comments, order, layout.

    table_mass_kg: 384.0    # Eq. 22    ->    table_mass_kg: 418.30   # +-0.85 kg; before 384    # Eq. 22

The text must be one that `hil.files.yaml_model` reads. Positions are those of PyYAML's nodes and tokens.
"""

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import yaml

from hil.errors import FieldPath

GAP = "   "  # before a comment


class YamlChange(NamedTuple):
    """A value for a path, as text of YAML or as mappings and lists, and a comment for its line; None: it stays."""

    path: FieldPath
    value: Any
    comment: str


class _Edit(NamedTuple):
    start: int
    order: int  # of edits at one place: values, comments, lines
    end: int
    text: str


def root_keys(text: str) -> set[str]:
    """Keys at the top level of a file."""
    return {key.value for key, _ in _root(text).value}


def comment_lines(text: str, indent: str = "") -> str:
    """Put lines into comments, behind their indentation where all have `indent`."""
    return "".join(f"{indent}# {line.removeprefix(indent)}\n" for line in text.splitlines())


def with_changes(text: str, changes: Sequence[YamlChange]) -> str:
    """Set values and add comments. A key that the file lacks is added at the end of its mapping; a mapping is merged.

    A comment on a key that the file lacks is a line of its own.

    Raises ValueError where the file has something else in the place of a mapping.
    """
    root, comments, edits = _root(text), dict[int, list[str]](), list[_Edit]()
    filled = set[int]()  # mappings in brackets that have an entry before the next one
    for change in [part for whole in changes for part in _parts(root, whole)]:
        parent, node, lacking = _find(root, change.path)
        key = change.path[len(change.path) - max(len(lacking), 1)]
        if not lacking:
            end = _end(node)
            line = node.start_mark.line if change.value is None else end.line
            if change.value is not None:
                edits.append(_Edit(node.start_mark.index, 0, end.index, _flow(change.value)))
        else:
            value = change.value
            for name in reversed(lacking[1:]):
                value = {name: value}
            if not isinstance(node, yaml.MappingNode):
                raise ValueError(f"{change.path}: the file has no mapping there")
            key = ".".join(map(str, lacking)) if change.value is None else key
            entry = f"# {key}" if change.value is None else f"{key}: {_flow(value)}"
            parent, line = node, _end(node).line
            if not node.flow_style:
                comment = f"{': ' if change.value is None else f'{GAP}# '}{change.comment}" if change.comment else ""
                below = _line_end(text, _end(node).index)
                edits.append(_Edit(below, 2, below, f"\n{' ' * node.start_mark.column}{entry}{comment}"))
                continue
            inside = node.end_mark.index - 1
            if change.value is not None:
                edits.append(_Edit(inside, 0, inside, f", {entry}" if node.value or inside in filled else entry))
                filled.add(inside)
        if change.comment:
            named = f"{key}: {change.comment}" if parent.flow_style else change.comment
            comments.setdefault(line, []).append(named)
    ends = _token_ends(text)
    edits += [_Edit(ends[line], 1, ends[line], f"{GAP}# {'; '.join(told)}") for line, told in comments.items()]
    return _applied(text, edits)


def with_items(text: str, key: str, items: str) -> str:
    """Add lines that hold items of a list (and comments) at the end of the list at a top-level key; make the key.

    Raises ValueError for a list in brackets that is not empty.
    """
    found = next((node for name, node in _root(text).value if name.value == key), None)
    if found is None:
        return f"{text.rstrip()}\n{key}:\n{_indented(items, 2)}"
    if isinstance(found, yaml.ScalarNode):  # all items are comments
        begin = _line_end(text, found.start_mark.index)
        return _applied(text, [_Edit(begin, 2, begin, "\n" + _indented(items, 2).rstrip("\n"))])
    if found.flow_style and found.value:
        raise ValueError(f"{key}: a list in brackets")
    edits = [_Edit(found.start_mark.index, 0, found.end_mark.index, "")] if found.flow_style else []
    below = _line_end(text, _end(found).index)
    new = "\n" + _indented(items, 2 if found.flow_style else found.start_mark.column).rstrip("\n")
    return _applied(text, [*edits, _Edit(below, 2, below, new)])


def without_item(text: str, key: str, index: int, why: str) -> str:
    """Put an item of the list at a top-level key into comments. Raises ValueError for a list in brackets."""
    found = next(node for name, node in _root(text).value if name.value == key)
    if found.flow_style:
        raise ValueError(f"{key}: a list in brackets")
    item, indent = found.value[index], " " * found.start_mark.column
    start = text.rfind("\n", 0, item.start_mark.index) + 1
    end = _line_end(text, _end(item).index)
    lines = f"{indent}{why}\n{text[start:end]}"
    return text[:start] + comment_lines(lines, indent).rstrip("\n") + text[end:]


def _root(text: str) -> yaml.MappingNode:
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if not isinstance(root, yaml.MappingNode):
        raise ValueError("the file holds no mapping")
    return root


def _parts(root: yaml.MappingNode, change: YamlChange) -> list[YamlChange]:
    """A change of each key of a mapping that the file has, the comment at the last; else the change itself."""
    _, node, lacking = _find(root, change.path)
    if lacking or not isinstance(change.value, dict) or not isinstance(node, yaml.MappingNode) or not node.value:
        return [change]
    parts = [YamlChange((*change.path, key), value, "") for key, value in change.value.items()]
    return [*parts[:-1], parts[-1]._replace(comment=change.comment)]


def _find(root: yaml.MappingNode, path: FieldPath) -> tuple[yaml.CollectionNode, yaml.Node, FieldPath]:
    """The node of a path with its parent, or the last one that is there; and what is lacking of the path."""
    parent: yaml.CollectionNode = root
    node: yaml.Node = root
    for depth, part in enumerate(path):
        if isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            parent, node = node, node.value[part]
            continue
        entries = node.value if isinstance(node, yaml.MappingNode) else []
        following = next((value for name, value in entries if name.value == part), None)
        if following is None:
            return parent, node, path[depth:]
        assert isinstance(node, yaml.MappingNode)
        parent, node = node, following
    return parent, node, ()


def _end(node: yaml.Node) -> yaml.Mark:
    """End of the last value of a node; the mark of a block is behind the comments that follow it."""
    if isinstance(node, yaml.CollectionNode) and node.value and not node.flow_style:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return node.end_mark


def _line_end(text: str, at: int) -> int:
    end = text.find("\n", at)
    return len(text) if end < 0 else end


def _token_ends(text: str) -> dict[int, int]:
    """Line -> index behind its last token, where a comment may begin."""
    ends = dict[int, int]()
    for token in yaml.scan(text, Loader=yaml.SafeLoader):
        if token.end_mark.index > token.start_mark.index:
            ends[token.end_mark.line] = token.end_mark.index
    return ends


def _flow(value: Any) -> str:
    """Text of a value; mappings and lists in brackets."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    return value if isinstance(value, str) else json.dumps(value)


def _indented(lines: str, columns: int) -> str:
    return "".join(f"{' ' * columns}{line}\n" for line in lines.splitlines())


def _applied(text: str, edits: Sequence[_Edit]) -> str:
    done, at = list[str](), 0
    for edit in sorted(edits, key=lambda one: one[:2]):
        done += [text[at : edit.start], edit.text]
        at = edit.end
    return "".join([*done, text[at:]])
