"""Every module of the live axis has tests against which its mutants run."""

from __future__ import annotations

from pathlib import Path

from modules import MODULES

ROOT = Path(__file__).parents[2]


def test_no_module_is_forgotten() -> None:
    files = [file for folder in ("drivers", "hil/loop") for file in (ROOT / folder).glob("*.py")]
    assert {str(file.relative_to(ROOT)) for file in files if file.name != "__init__.py"} == set(MODULES)


def test_the_tests_are_there() -> None:
    assert all((ROOT / test).is_file() for suite in MODULES.values() for test in suite.tests)
