"""Each column of numbers is a channel, the clock, or is listed once with the reason why it is not used."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import hil
from foreign_axis import axis, write
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text

AXIS = axis(rows=1500)
RANDOM = np.random.default_rng(3)
COMMANDED = np.interp(AXIS["t"] + 0.004, AXIS["t"], AXIS["speed"])
MORE = {
    "velocity_setpoint_rpm": COMMANDED * 30.0 / np.pi,
    "demand velocity filtered [rpm]": 0.97 * COMMANDED * 30.0 / np.pi,
    "actual velocity [rpm]": AXIS["speed"] * 30.0 / np.pi,
    "load speed [rpm]": 0.1 * AXIS["speed"],
    "position_setpoint_mm": AXIS["x_set"],
    "position_setpoint_2_mm": 2.0 * AXIS["x_set"],
    "following error [mm]": 1e-3 * AXIS["speed"],
    "torque_setpoint_Nm": AXIS["torque"],
    "friction torque [Nm]": np.sign(AXIS["speed"]),
    "acceleration [rad/s^2]": np.gradient(AXIS["speed"], AXIS["t"]),
    "bus voltage": 560.0 + RANDOM.normal(size=1500),
    "status": np.zeros(1500),
    "blub": RANDOM.normal(size=1500),
    "time of the controller [ms]": 1e3 * AXIS["t"],
    "empty": np.where(np.arange(1500) < 40, 3.0, np.nan),
    "table position [mm]": AXIS["x_act"],
    "slide position [mm]": 1.1 * AXIS["x_act"],
}
MOTION = {"position": {"angle": "motor_angle_rad"}, "velocity": {"speed": "motor speed [rad/s]"}}


@settings(deadline=None, max_examples=20)
@given(motion=st.sampled_from(sorted(MOTION)), names=st.lists(st.sampled_from(sorted(MORE)), unique=True, max_size=6))
@pytest.mark.long
def test_each_column_is_used_or_listed_once(
    tmp_path_factory: pytest.TempPathFactory, motion: str, names: list[str]
) -> None:
    base = {"t": "time_s", "torque": "torque_Nm"} | MOTION[motion]
    columns = {new: AXIS[old] for old, new in base.items()} | {name: MORE[name] for name in names}
    draft = draft_map(write(tmp_path_factory.getbasetemp() / "log.csv", columns))
    used = {str(one.entry["column"]) for one in draft.channels} | draft.clock.columns
    assert used | set(draft.left_out) == set(columns)
    assert not used & set(draft.left_out)
    assert "no channel takes it" not in draft.left_out.values()
    text = map_text(draft)
    for name, why in draft.left_out.items():
        assert text.count(f"#   {name}: {why}") == 1


def test_a_velocity_set_point_without_one_of_the_position_is_named(tmp_path: Path) -> None:
    columns = {"time_s": AXIS["t"], "demand velocity [rpm]": COMMANDED, "actual velocity [rpm]": AXIS["speed"],
               "torque_Nm": AXIS["torque"]}  # fmt: skip
    write(tmp_path / "log.csv", columns)
    ran = hil(tmp_path, "import", "log.csv")
    assert ran.returncode == 0
    assert "Not used, with reasons at the end of the map: demand velocity [rpm]" in " ".join(ran.stderr.split())
    assert "#   demand velocity [rpm]: a set-point of the velocity; " in (tmp_path / "log-map.yaml").read_text()
