"""Measured recordings that are not part of the repository; tests of the net skip where they are not beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.importing.by_map import import_recording
from hil.recording.recording import Recording

SHARED = Path(__file__).parents[2].parent / "shared" / "recordings"


def shared(name: str) -> Path:
    """A file or folder of the recordings; skips the test without it."""
    if not (SHARED / name).exists():
        pytest.skip(f"the recording {name} is not beside the repository")
    return SHARED / name


def emps() -> Recording:
    """The EMPS recording as published."""
    return import_recording(shared("emps/DATA_EMPS.mat"), "emps")


def rig(folder: str) -> Path:
    """A folder of rig recordings."""
    return shared(f"rig/{folder}")
