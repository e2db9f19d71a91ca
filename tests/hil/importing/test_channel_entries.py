"""A speed set-point is told: the velocity of the position set-point, or the output of the position loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_axis import LEAD_M, axis, renamed, write

from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft

AXIS = axis()
NAMES = {"t": "time_s", "x_set": "position_setpoint_mm", "angle": "motor_angle_rad", "torque": "torque_Nm"}


def channels(draft: MapDraft) -> dict[str, Any]:
    return {one.channel: one.entry for one in draft.channels}


@pytest.mark.parametrize("feedforward", [1.0, 0.0])
def test_a_speed_set_point_with_the_following_error_is_the_output_of_the_position_loop(
    tmp_path: Path, feedforward: float
) -> None:
    gain_1_s = 40.0
    error_rad = AXIS["torque"] / 20.0 + (1.0 - feedforward) * AXIS["speed"] / gain_1_s
    angle_set = AXIS["angle"] + error_rad
    speed = feedforward * np.gradient(angle_set, AXIS["t"]) + gain_1_s * error_rad
    set_points = {"x_set": 1e3 * LEAD_M / (2.0 * np.pi) * angle_set, "n_set": speed}
    columns = renamed(AXIS | set_points, **NAMES, n_set="speed_setpoint_rad_s")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert channels(draft)["velocity_reference_m_s"]["column"] == "speed_setpoint_rad_s"
    assert "velocity_command_m_s" not in channels(draft)


def test_a_speed_set_point_without_it_is_the_velocity_of_the_set_point(tmp_path: Path) -> None:
    speed = np.gradient(AXIS["x_set"], AXIS["t"])
    columns = renamed(AXIS | {"v_set": speed}, **NAMES, v_set="velocity_setpoint_mm_s")
    assert channels(draft_map(write(tmp_path / "log.csv", columns)))["velocity_command_m_s"]
