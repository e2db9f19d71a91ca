"""Short files of constant speeds: each tells little, and all have one map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from foreign_axis import write

from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text


def run(folder: Path, rpm: float) -> Path:
    random = np.random.default_rng(round(abs(rpm)))
    t = 0.005 * np.arange(560)
    angle = np.mod(190.0 + 6.0 * rpm * t, 360.0)
    torque = 0.2 * np.sign(rpm) + 1e-4 * rpm + random.normal(0.0, 0.02, t.size)
    speed = rpm + random.normal(0.0, 0.3, t.size)
    columns = {"t[s]": t, "n[rpm]": np.round(speed, 1), "angle[deg]": np.round(angle, 2), "M[Nm]": np.round(torque, 3)}
    return write(folder / f"run_{rpm:g}.csv", columns)


@pytest.mark.parametrize("rpm", [1700.0, -2200.0, 2700.0])
def test_files_of_other_speeds_have_the_same_map(rpm: float, tmp_path: Path) -> None:
    drafts = [draft_map(run(tmp_path, speed)) for speed in (300.0, rpm)]
    maps = [yaml.safe_load(map_text(draft)) | {"about": ""} for draft in drafts]
    assert maps[0] == maps[1]
    assert maps[0]["channels"]["motor_position_rad"] == {"column": "angle[deg]", "unit": "deg", "wraps_at": 360.0}
    assert not any("derivative" in note for draft in drafts for note in draft.unsure)
