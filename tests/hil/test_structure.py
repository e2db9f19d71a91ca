"""Limits on the layout of the source: unique class names, a short root, files that can be read, no tests imported."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for package in ("hil", "drivers") for path in (ROOT / package).rglob("*.py"))
MOST_LINES = 300
MOST_FILES_AT_ROOT = 10
TESTS = {"tests", *(path.stem for path in (ROOT / "tests" / "support").glob("*.py"))}
IDS = [str(path.relative_to(ROOT)) for path in SOURCES]


def test_every_class_name_is_unique() -> None:
    places = defaultdict(list)
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(str(path.relative_to(ROOT)))
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_the_root_of_hil_holds_few_files() -> None:
    files = [path.name for path in (ROOT / "hil").iterdir() if path.is_file()]
    assert len(files) <= MOST_FILES_AT_ROOT, files


@pytest.mark.parametrize("path", SOURCES, ids=IDS)
def test_no_source_file_is_too_long(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= MOST_LINES


def test_no_module_imports_the_tests() -> None:
    imported = [
        (path.name, name)
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module or ""] if isinstance(node, ast.ImportFrom) else [one.name for one in node.names])
        if name.split(".")[0] in TESTS
    ]
    assert imported == []
