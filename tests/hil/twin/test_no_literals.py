"""A mechanism is known by its own file alone: no effect id and no parameter name as a literal elsewhere in the code."""

import ast
from dataclasses import fields
from pathlib import Path

import drivers
import hil
from hil.bench import axis_models
from hil.channels import CHANNELS
from hil.diagnosis.location.periodicity import Lock
from hil.twin.library import LIBRARY

ROOTS = [Path(package.__path__[0]) for package in (hil, drivers)]
# The library itself, and what draws or simulates an axis whose truth is known: both name effects on purpose.
DRAWN = ("hil/twin/mechanisms", "hil/twin/library.py", "hil/validation/proof/draw", "drivers/sim")
IDS = {mechanism.id for mechanism in LIBRARY}
VARIANTS = {f"{mechanism.id}.{form}" for mechanism in LIBRARY for form in mechanism.forms if form}
PARAMETERS = {name for mechanism in LIBRARY for name in mechanism.names}


def also_something_else():
    """Names that are also nominal parameters of an axis model, recorded channels, or entries of a location."""
    models = [model for model in vars(axis_models).values() if hasattr(model, "model_fields")]
    nominal = {name for model in models for name in model.model_fields}
    return nominal | set(CHANNELS) | {field.name for field in fields(Lock)}


def literals(source):
    """String constants of a module with their lines, without docstrings."""
    tree = ast.parse(source)
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.lineno, node.value


def test_literals_are_seen() -> None:
    assert list(literals('"""backlash"""\nx = {"backlash": 1}')) == [(2, "backlash")]


def test_no_effect_and_no_parameter_is_named_outside_its_file() -> None:
    forbidden = (IDS | VARIANTS | PARAMETERS) - also_something_else()
    assert forbidden > IDS
    found, files = [], 0
    for root in ROOTS:
        for path in sorted(root.rglob("*.py")):
            place = path.relative_to(root.parent).as_posix()
            if not place.startswith(DRAWN):
                files += 1
                found += [f"{place}:{line} {text}" for line, text in literals(path.read_text()) if text in forbidden]
    assert files > 100
    assert not found
