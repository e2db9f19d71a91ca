"""A seeded share of the fuzzing; `make fuzz` does the whole."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import pytest
from targets import EXPECTED, TARGETS


@pytest.mark.parametrize("target", list(TARGETS))
def test_damaged_input_ends_in_an_error_on_purpose(tmp_path: Path, target: str) -> None:
    for number in range(40):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                TARGETS[target](random.Random(f"{target} 9.{number}"), tmp_path)
            except EXPECTED:
                continue
