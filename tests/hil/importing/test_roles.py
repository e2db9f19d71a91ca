"""Which column is the motion: following errors and speeds among columns that look like positions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, renamed, write

from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.lexicon import Quantity

AXIS = axis()


@pytest.mark.parametrize(
    "name",
    [
        "droop pulses [pulse]", "溜りパルス[pulse]", "位置偏差[pulse]", "滞留脉冲 [inc]", "Schleppfehler [Inkr]",
        "Erreur de trainage [inc]", "scarto di posizione [inc]", "desviacion de posicion [inc]", "volgfout [inc]",
        "рассогласование [inc]", "joint.0.f-error [inc]", "PosErr [inc]", "FOLLERR [inc]", "position lag [inc]",
    ],
)  # fmt: skip
def test_a_following_error_is_no_position_by_its_name(name: str) -> None:
    assert label(name).quantity is Quantity.OTHER


def test_a_following_error_is_no_position_by_its_values(tmp_path: Path) -> None:
    """The velocity over the gain, whatever its name."""
    error = np.round(AXIS["speed"] / 30.0 / 1e-4)
    columns = {"time_s": AXIS["t"], "P1 [inc]": error, "speed [rad/s]": AXIS["speed"],
               "torque_Nm": AXIS["torque"]}  # fmt: skip
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {one.channel: one.entry["column"] for one in draft.channels} == {
        "motor_velocity_rad_s": "speed [rad/s]",
        "torque_n_m": "torque_Nm",
    }
    assert not draft.asked
    assert any("grows with speed [rad/s] itself, as a following error does" in note for note in draft.unsure)


def test_a_speed_by_its_letter_is_no_position_where_it_explains_a_column_better(tmp_path: Path) -> None:
    columns = renamed(AXIS, t="t", speed="n", torque="m")
    draft = draft_map(write(tmp_path / "log.csv", columns))
    assert {one.channel: one.entry["column"] for one in draft.channels} == {
        "motor_velocity_rad_s": "n",
        "torque_n_m": "m",
    }
