"""Each dialect of docs/recordings.md, imported without a map: period, angle and torque are those of the known axis."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path

import numpy as np
import pytest
from dialects import ANGLE, DIALECTS, TORQUE

from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text

# the ids of the columns and not their units are in these: the result is in other units, and says so
WITHOUT_UNITS = {"LinuxCNC halsampler", "ODrive, JSON", "EPICS camonitor"}
WITHOUT_A_CLOCK = {"LinuxCNC halsampler": 1000.0}
LIBRARIES = {"mf4": "asammdf"}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_is_imported_without_a_map(tmp_path: Path, dialect: str) -> None:
    ending, write = DIALECTS[dialect]
    library = LIBRARIES.get(ending)
    if library and importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is an optional extra and not installed")
    path, map_path = tmp_path / f"axis.{ending}", tmp_path / "map.yaml"
    with warnings.catch_warnings():
        if library:
            warnings.simplefilter("ignore")
        write(path)
        draft = draft_map(path, WITHOUT_A_CLOCK.get(dialect))
        map_path.write_text(map_text(draft))
        recording = import_recording(path, map_path)
    assert recording.period_s == pytest.approx(1e-3, rel=1e-4)
    rows = len(recording)
    assert rows >= ANGLE.size - 1
    found, given = recording[recording.axis.motor_position], ANGLE[-rows:]
    if dialect in WITHOUT_UNITS:
        assert any("is taken" in note for note in draft.unsure)
        found = found * np.ptp(given) / np.ptp(found)
    np.testing.assert_allclose(found - found[0], given - given[0], atol=4e-3)
    np.testing.assert_allclose(recording[recording.axis.torque], TORQUE[-rows:], atol=3e-3)
