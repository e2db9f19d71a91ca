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


def test_an_angle_of_half_a_turn_from_row_to_row_is_no_position(tmp_path: Path) -> None:
    """By the shortest way round it would turn backwards above 3000 rpm, and so would the sign of the torque."""
    t = 0.01 * np.arange(1800)
    rpm = np.interp(t, [1.0, 4.0, 8.0, 14.0, 17.0], [0.0, 3200.0, 3200.0, -3200.0, 0.0])
    angle = np.mod(np.cumsum(6.0 * rpm) * 0.01, 360.0)
    torque = 0.2 * np.sign(rpm) + 1e-4 * rpm + 2e-4 * np.gradient(rpm, t)
    torque += np.random.default_rng(1).normal(0.0, 0.01, t.size)
    columns = {"t[s]": t, "n[rpm]": np.round(rpm, 1), "angle[deg]": np.round(angle, 2), "M[Nm]": np.round(torque, 3)}
    draft = draft_map(write(tmp_path / "run.csv", columns))
    channels = yaml.safe_load(map_text(draft))["channels"]
    assert "motor_position_rad" not in channels
    assert {"column": "n[rpm]", "unit": "rpm"} in channels.values()
    assert "sign" not in channels["torque_n_m"]
    assert draft.left_out["angle[deg]"] == "n[rpm] goes half of its range and more from row to row"


@pytest.mark.parametrize("ratio", [50.0, 1.7])
def test_a_speed_of_another_shaft_loses_no_angle(ratio: float, tmp_path: Path) -> None:
    t = 0.01 * np.arange(1800)
    rpm = np.interp(t, [1.0, 4.0, 8.0, 14.0, 17.0], [0.0, 60.0, 60.0, -60.0, 0.0])
    angle = np.mod(np.cumsum(6.0 * rpm) * 0.01, 360.0)
    of_motor = ratio * 60.0 * rpm if ratio < 2.0 else ratio * 1.3 * rpm
    torque = 0.2 * np.sign(rpm) + 1e-3 * rpm + 2e-3 * np.gradient(rpm, t)
    torque += np.random.default_rng(1).normal(0.0, 0.01, t.size)
    columns = {
        "t[s]": t,
        "n_mot[rpm]": np.round(of_motor, 1),
        "angle[deg]": np.round(angle, 2),
        "M[Nm]": np.round(torque, 3),
    }
    draft = draft_map(write(tmp_path / "run.csv", columns))
    assert "angle[deg]" not in draft.left_out
