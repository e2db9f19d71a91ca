"""A mechanism is known by its own file alone: elsewhere no code names it, nor picks it from the library by a flag.

What one mechanism needs of its own is a function that it provides; its users run over all mechanisms.
"""

import ast
from dataclasses import fields
from pathlib import Path

import pytest

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
FORMS = {form for mechanism in LIBRARY for form in mechanism.forms if form}
COLLECTIONS = ("LIBRARY", "BY_ID", "SLOTS")
OF_FORM = ("variant.name", "form.name", "parameter.name", "mechanism.id", ".effect", ".forms[0]")
PARAMETERS = {name for mechanism in LIBRARY for name in mechanism.names}


def also_something_else():
    """Names that are also nominal parameters of an axis model, recorded channels, or entries of a location."""
    models = [model for model in vars(axis_models).values() if hasattr(model, "model_fields")]
    nominal = {name for model in models for name in model.model_fields}
    return nominal | set(CHANNELS) | {field.name for field in fields(Lock)}


def sources():
    """Place and text of each source file that must not name a mechanism."""
    files = [(path.relative_to(root.parent).as_posix(), path) for root in ROOTS for path in sorted(root.rglob("*.py"))]
    found = [(place, path.read_text()) for place, path in files if not place.startswith(DRAWN)]
    assert len(found) > 100
    return found


def literals(source):
    """String constants of a module with their lines, without docstrings."""
    tree = ast.parse(source)
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.lineno, node.value


def picks(source):
    """Lines that take one mechanism out of the library: next(... in LIBRARY ...), or an element of such a list."""
    for node in ast.walk(ast.parse(source)):
        is_next = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "next"
        taken = node.args[0] if is_next else node.value if isinstance(node, ast.Subscript) else None
        if isinstance(taken, ast.GeneratorExp | ast.ListComp):
            over = ast.unparse(taken.generators[0].iter)
            if over.removeprefix("enumerate(").removesuffix(")").removesuffix("()").split(".")[0] in COLLECTIONS:
                yield node.lineno


def compared(source):
    """Lines that compare the name of a variant or a parameter, or any name of a parameter, with a literal."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            names = {one.value for side in sides for one in ast.walk(side) if isinstance(one, ast.Constant)}
            of_form = any(ast.unparse(side).endswith(OF_FORM) for side in sides)
            if names & (PARAMETERS - set(CHANNELS)) or (of_form and names & FORMS):
                yield node.lineno


@pytest.mark.parametrize(
    "line",
    [
        "next(m for m in LIBRARY if m.transient)",
        "next((m.id for m in BY_ID.values() if m.search.beside), None)",
        "next(v for m in SLOTS for v in m.variants if v.contact)",
        "[m for m in LIBRARY if m.transient][0]",
        "next(i for i, m in enumerate(LIBRARY) if m.transient)",
    ],
)
def test_a_mechanism_picked_by_a_flag_is_seen(line) -> None:
    assert list(picks(line)) == [1]
    assert not list(picks(f"found = [{line.count('m')} for m in LIBRARY]"))


@pytest.mark.parametrize(
    "line",
    ['variant.name != "torque"', 'active.form.name == "torque"', 'name == "damping_ratio"', 'n in ("share", "x")'],
)
def test_a_compared_name_is_seen(line) -> None:
    assert list(compared(line)) == [1]
    assert not list(compared(line.replace('"torque"', "other").replace("damping_ratio", "x").replace('"share"', "y")))


def test_literals_are_seen() -> None:
    assert list(literals('"""backlash"""\nx = {"backlash": 1}')) == [(2, "backlash")]


def test_no_effect_and_no_parameter_is_named_outside_its_file() -> None:
    forbidden = (IDS | VARIANTS | PARAMETERS) - also_something_else()
    assert forbidden > IDS
    found = [(place, one) for place, text in sources() for one in literals(text) if one[1] in forbidden]
    assert not found


@pytest.mark.parametrize("refused", [picks, compared])
def test_no_mechanism_is_picked_and_no_name_compared_outside_the_library(refused) -> None:
    assert [f"{place}:{line}" for place, text in sources() for line in refused(text)] == []
