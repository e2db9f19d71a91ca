"""A column that names a torque or current comes before one that the motion alone suggests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from foreign_axis import axis, write

from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft


def drafted(folder: Path, **more: np.ndarray) -> MapDraft:
    """Draft of an axis whose current has a ripple that its motion does not explain, with more columns."""
    columns = axis()
    ripple = 1.5 * np.sin(40.0 * columns["angle"])
    table = {"time_s": columns["t"], "position_rad": columns["angle"], "current_A": columns["torque"] + ripple}
    return draft_map(write(folder / "axis.csv", table | more))


def column_of(draft: MapDraft, channel: str) -> object:
    return next(one.entry["column"] for one in draft.channels if one.channel == channel)


def test_a_named_current_comes_before_an_unnamed_column_that_the_motion_explains_better(tmp_path: Path) -> None:
    draft = drafted(tmp_path, zeta=axis()["torque"])
    assert column_of(draft, "torque_n_m") == "current_A"
    assert "zeta" in draft.left_out


def test_a_switch_is_no_torque(tmp_path: Path) -> None:
    """It follows the direction as Coulomb friction does."""
    columns = axis()
    table = {"time_s": columns["t"], "position_rad": columns["angle"], "state": np.sign(columns["speed"])}
    draft = draft_map(write(tmp_path / "axis.csv", table | {"zeta": columns["torque"]}))
    assert column_of(draft, "torque_n_m") == "zeta"
    assert "state" in draft.left_out


def test_a_column_in_percent_that_is_the_position_is_no_torque(tmp_path: Path) -> None:
    """A valve tells its opening so; a column in % that friction and inertia make is a torque."""
    columns = axis()
    table = {"time_s": columns["t"], "position_rad": columns["angle"], "opening [%]": 50.0 + 3.0 * columns["angle"]}
    draft = draft_map(write(tmp_path / "axis.csv", table | {"zeta [%]": 10.0 * columns["torque"]}))
    assert column_of(draft, "torque_n_m") == "zeta [%]"
    assert "a position in %" in draft.left_out["opening [%]"]
    alone = draft_map(write(tmp_path / "alone.csv", table))
    assert column_of(alone, "torque_n_m") == ""
