"""A load that is put on in the part of a recording that is held out."""

from __future__ import annotations

from pathlib import Path

import pytest
from axis_change import assert_change_is_told

pytestmark = pytest.mark.net


def test_a_change_in_the_part_held_out_is_said(tmp_path: Path) -> None:
    assert_change_is_told(tmp_path, 9000)
