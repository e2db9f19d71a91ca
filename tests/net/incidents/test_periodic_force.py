"""A force of fixed frequency: found on a simulated axis, told from what goes with the position and from windows."""

from __future__ import annotations

import numpy as np
import pytest
from concealed_run import concealed_run
from diagnosis_runs import bench

import hil
from hil.recording.recording import Recording
from hil.twin.library import BY_ID

pytestmark = pytest.mark.net

OWNER = bench()
MECHANISM = BY_ID["periodic_force"]


def recorded(effect: str, parameters: dict[str, float]) -> Recording:
    """A recording of the simulated axis with an effect, at two feeds."""
    return concealed_run(OWNER, {effect: parameters})


def test_a_force_of_fixed_frequency_is_found_and_holds_in_the_part_held_out() -> None:
    parameters = {"force_n": 150.0, "frequency_hz": 3.7, "phase_rad": 0.6}
    result = hil.diagnose(recorded(MECHANISM.id, parameters), OWNER).result
    (finding,) = result.missing
    assert finding.effect == MECHANISM.id
    for name in ("force_n", "frequency_hz"):
        assert finding.parameters[name].value == pytest.approx(parameters[name], rel=0.02)
    # the simulated axis runs for a few ticks before the first row
    before_s = (finding.parameters["phase_rad"].value - parameters["phase_rad"]) / (2.0 * np.pi * 3.7)
    assert -1e-3 < before_s < 10e-3
    assert result.location.frequency_hz == pytest.approx(3.7, rel=1e-3)
    assert "3.7" in result.statement


def test_what_goes_with_the_angle_of_the_motor_keeps_its_name() -> None:
    parameters = {"amplitude_n_m": 0.25, "cycles_per_rev": 1.0, "phase_rad": 0.5}
    result = hil.diagnose(recorded("cogging_torque", parameters), OWNER).result
    assert MECHANISM.id not in [finding.effect for finding in result.missing]
