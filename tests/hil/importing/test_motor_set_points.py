"""Set-points that a drive gives in its motor's counts become those of the load; others stay as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from foreign_axis import axis, write
from hypothesis import given
from hypothesis import strategies as st

from hil.channels import AXIS_CHANNELS, AxisKind
from hil.importing.by_map import import_recording
from hil.importing.encoder_counts import angle_count
from hil.importing.motor_set_points import gear_of_set_points

NAMES = AXIS_CHANNELS[AxisKind.ROTARY]


def columns(gear: float, commanded: float) -> dict[str, np.ndarray]:
    """Motor, load and set-points `commanded` times as far as the motor, which follows them by 4 ms."""
    time_s = np.arange(4000) * 1e-3
    late, now = (40.0 * np.sin(1.7 * at) + 12.0 * np.sin(5.1 * at) for at in (time_s + 0.004, time_s))
    return {
        NAMES.motor_position: now,
        NAMES.table_position: now / gear + 0.3,
        NAMES.position_command: commanded * late,
    }


@given(st.integers(2, 200).map(float) | st.floats(1.1, 200.0), st.sampled_from([1.0, -1.0]))
def test_set_points_of_the_motor_are_divided_by_the_gear(gear: float, sense: float) -> None:
    found = gear_of_set_points(columns(sense * gear, 1.0), NAMES)
    assert found == pytest.approx(sense * gear, abs=0.05)
    assert gear_of_set_points(columns(sense * gear, 1.0 / found), NAMES) == 1.0  # once


@pytest.mark.parametrize("gear", [1.0, 1.005, -1.0])
def test_without_a_gear_they_stay(gear: float) -> None:
    assert gear_of_set_points(columns(gear, 1.0), NAMES) == 1.0


def test_without_a_second_encoder_they_stay() -> None:
    alone = columns(36.0, 1.0)
    del alone[NAMES.table_position]
    assert gear_of_set_points(alone, NAMES) == 1.0


def test_counts_of_a_drive(tmp_path: Path) -> None:
    """Objects 6062h and 6064h in the motor's counts, 60E4h in those of an encoder on the load behind a gear of 36."""
    driven, gear, counts = axis(), 36.0, {"motor": 65536, "load": 1440000}
    turns = driven["angle"] / (2.0 * np.pi)
    late = np.interp(driven["t"] + 0.004, driven["t"], turns, right=turns[-1])
    table = {
        "6062": np.round(counts["motor"] * late),
        "6064": np.round(counts["motor"] * turns),
        "60E4h": 7000.0 + np.round(counts["load"] * turns / gear),
        "Nm": driven["torque"],
    }
    entries = {
        "position_command_m": {"column": "6062", "unit": "counts", "counts_per_rev": counts["motor"]},
        "motor_position_rad": {"column": "6064", "unit": "counts", "counts_per_rev": counts["motor"]},
        "table_position_m": {"column": "60E4h", "unit": "counts", "counts_per_rev": counts["load"]},
        "torque_n_m": {"column": "Nm", "unit": "N m"},
    }
    text = {"about": "test", "sample_rate_hz": 1000.0, "lead_m": 2.0 * np.pi, "channels": entries}
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(text))
    recording = import_recording(write(tmp_path / "log.csv", table), tmp_path / "map.yaml")
    later = np.interp(driven["t"] + 0.004, driven["t"], recording["table_position_m"])
    ahead = (recording["position_command_m"] - later)[:-5]
    assert ahead - ahead[0] == pytest.approx(0.0, abs=2e-5)  # counts of both encoders
    assert "gear ratio 36 " in recording.metadata["clock_notes"][0]
    factor = recording.metadata["channels"]["position_command_m"]["factor"]
    assert factor == pytest.approx(2.0 * np.pi / counts["motor"] / gear)


@pytest.mark.parametrize(
    ("size", "unit", "taken"),
    [(0.00500006, "deg", 0.005), (0.00034332302, "deg", 360.0 / 2**20), (0.0050123, "deg", 0.0050123)],
)
def test_the_count_of_an_angle_is_a_round_one_if_one_is_near(size: float, unit: str, taken: float) -> None:
    """A set-point tells it as well as the axis follows: an error of the count would be one of the transmission."""
    assert angle_count(size, unit) == pytest.approx(taken, rel=1e-9)
