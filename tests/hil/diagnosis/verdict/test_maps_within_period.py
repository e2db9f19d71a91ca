"""A residual that repeats within a period of the position gets a map if no mechanism names it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import LEAD_M, axis, write

from hil.explanation import explain
from hil.twin.maps import READING_WITHIN_PERIOD, knots
from hil.twin.mechanism import Moment

PERIOD_M, AMPLITUDE_M = 0.03, 20e-6  # of a wheel behind a gear: three turns of the motor


@pytest.mark.long
def test_a_wheel_behind_a_gear_that_runs_out_has_a_map(tmp_path: Path) -> None:
    columns = axis(12_000)
    way_m = LEAD_M / (2.0 * np.pi) * columns["angle"]
    table_m = way_m + AMPLITUDE_M * np.sin(2.0 * np.pi * way_m / PERIOD_M + 0.9)
    recorded = {
        "time_s": columns["t"],
        "motor_angle_rad": columns["angle"],
        "table_mm": 1e3 * np.round(table_m / 1e-7) * 1e-7,
        "torque_Nm": columns["torque"],
    }
    found = explain([write(tmp_path / "log.csv", recorded)], tmp_path / "out").diagnosis
    assert not found.result.missing
    (told,) = found.result.unnamed
    assert told.effect == READING_WITHIN_PERIOD.id
    assert told.parameters["last_position_m"] == pytest.approx(PERIOD_M, rel=0.02)
    assert told.held_out_after < 0.3 * told.held_out_before
    share = 100.0 * told.held_out_after / told.held_out_before
    assert f"a map of the reading within period leaves {share:.3g} % of that residual" in found.result.statement


def test_a_map_repeats_and_passes_through_its_knots() -> None:
    values = (0.0, 0.06, 1.0, 3.0, 2.0, -1.0, -2.0, 0.5)
    places, heights = knots(values, 0.06)
    assert heights[0] == heights[-1]
    law, none = READING_WITHIN_PERIOD.variants[0].contribution, np.zeros(1)

    def reading(position_m: float) -> float:
        at = Moment(0.0, 0.0, 1e-3, 1e-3, 0.0, 0.0, position_m, 1.0, 0.0)
        return float(law(0.0, at, np.array(values), none))

    for place, height in zip(places, heights, strict=True):
        for turns in (-2, 0, 3):
            assert reading(place + turns * 0.06) == pytest.approx(height, abs=1e-6)
    assert reading(0.005) == pytest.approx(2.0)
