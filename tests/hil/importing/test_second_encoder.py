"""A second encoder that agrees with the motor's to its noise is no copy of it, and tells no lesser gear."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, write

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text

AXIS = axis()
RANDOM = np.random.default_rng(2)
GEAR = 90.0
DEGREES = np.rad2deg(AXIS["angle"])
NOISE = 2e-7 * np.ptp(DEGREES)  # below a millionth of the travel


def drafted(folder: Path, second: np.ndarray, **more: np.ndarray) -> MapDraft:
    columns = {
        "time_s": AXIS["t"],
        "encoder 1 [deg]": DEGREES,
        "encoder 2 [deg]": second,
        "torque [Nm]": AXIS["torque"],
    }
    return draft_map(write(folder / "log.parquet", columns | more))


def channels(draft: MapDraft) -> dict[str, dict[str, object]]:
    return {one.channel: one.entry for one in draft.channels}


def test_a_sensor_with_noise_of_its_own_is_no_copy(tmp_path: Path) -> None:
    noisy = DEGREES + RANDOM.normal(0.0, NOISE, DEGREES.size)
    assert channels(drafted(tmp_path, noisy))["table_position_m"]["column"] == "encoder 2 [deg]"


@pytest.mark.parametrize("copy", [DEGREES, np.deg2rad(DEGREES), DEGREES.astype(np.float32), np.round(DEGREES, 4)])
def test_the_same_numbers_in_another_unit_or_rounding_are_a_copy(tmp_path: Path, copy: np.ndarray) -> None:
    draft = drafted(tmp_path, copy)
    assert "table_position_m" not in channels(draft)
    assert draft.left_out["encoder 2 [deg]"].startswith("a copy")


def test_both_encoders_in_angles_of_the_load_leave_the_gear_of_the_motors_speed(tmp_path: Path) -> None:
    noisy = DEGREES + RANDOM.normal(0.0, NOISE, DEGREES.size)
    rpm = GEAR * AXIS["speed"] * 30.0 / np.pi
    draft = drafted(tmp_path, noisy, **{"motor speed [rpm]": rpm})
    found = channels(draft)
    assert found["motor_position_rad"]["scale"] == pytest.approx(GEAR, rel=1e-3)
    assert "scale" not in found["table_position_m"]


def test_a_channel_named_as_an_angle_of_the_load_is_explained(tmp_path: Path) -> None:
    text = map_text(drafted(tmp_path, DEGREES + RANDOM.normal(0.0, NOISE, DEGREES.size)))
    path = tmp_path / "map.yaml"
    path.write_text(text.replace("table_position_m:", "table_position_rad:"))
    with pytest.raises(InputError, match="of a load that turns table_position_m with the unit rad or deg"):
        import_recording(tmp_path / "log.parquet", path)
