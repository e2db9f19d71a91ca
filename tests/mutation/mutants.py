"""Mutants of a source text by the operators of cosmic-ray, and which of them are left out.

Left out are changes that say nothing of the tests:

- an operator replaced by one of another kind (a shift for a product of floats, `==` for `is`): it raises TypeError at
  its first use or changes nothing; of signs and `not` only the deletion, of which the others are repetitions
- `^` for `|`: the flags that are joined have no bit in common; powers: that of two counts takes minutes
- annotations, which nothing evaluates; the `*` before keyword arguments, which is no operator
- decorators of numba and their arguments, `slots` and `frozen` of dataclasses, without which the same values come out
"""

from __future__ import annotations

import ast
import difflib
import re
from typing import NamedTuple

import parso
from cosmic_ray.ast import ast_nodes
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

KINDS = (
    {"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"},
    {"BitAnd", "BitOr", "BitXor", "LShift", "RShift"},
    {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"},
    {"Is", "IsNot"},
)
Position = tuple[int, int]  # line, column


class Mutant(NamedTuple):
    """The occurrence of an operator's change in a text."""

    operator: str
    occurrence: int

    def text(self, source: str) -> str:
        """Return the changed text."""
        changed = mutate_code(source, get_operator(self.operator)(), self.occurrence)
        assert changed is not None
        return changed

    def change(self, source: str) -> str:
        """Return the lines that differ, in one line."""
        lines = difflib.unified_diff(source.splitlines(), self.text(source).splitlines(), n=0, lineterm="")
        return " ".join(f"{line[0]} {line[1:].strip()}" if line[0] in "+-" else line for line in list(lines)[2:])


def mutants_of(source: str) -> list[Mutant]:
    """Return all mutants of a source text that are not left out, in a fixed order."""
    tree, spans = parso.parse(source), _annotations(source)
    found: list[Mutant] = []
    for name in sorted(operator_names()):
        if get_operator(name).arguments() or _says_nothing(name):
            continue
        operator = get_operator(name)()
        places = [place for node in ast_nodes(tree) for place in operator.mutation_positions(node)]
        for occurrence, (begin, _) in enumerate(places):
            annotated = any(first <= begin < last for first, last in spans)
            line, column = source.splitlines()[begin[0] - 1], begin[1]
            same = (
                line.startswith("@njit")
                or line[:column].endswith(("slots=", "frozen="))
                or line[column:].startswith("*,")
            )
            dotted = name.endswith("/ExceptionReplacer") and re.match(r"\w+\.", line[column:])  # which it cannot change
            if not (annotated or same or dotted):
                found.append(Mutant(name, occurrence))
    return found


def _says_nothing(name: str) -> bool:
    _, *operators = name.split("_")
    if operators == ["BitOr", "BitXor"] or operators[1:] == ["Pow"]:
        return True
    if "UnaryOperator" in name:
        return operators[0] != "Delete"
    return len(operators) == 2 and not any(set(operators) <= kind for kind in KINDS)


def _annotations(source: str) -> list[tuple[Position, Position]]:
    """Return begin and end of each annotation."""
    nodes = [getattr(node, name, None) for node in ast.walk(ast.parse(source)) for name in ("annotation", "returns")]
    return [
        ((node.lineno, node.col_offset), (node.end_lineno or 0, node.end_col_offset or 0)) for node in nodes if node
    ]
