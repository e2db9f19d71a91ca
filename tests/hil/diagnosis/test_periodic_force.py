"""A force of fixed frequency: found on a simulated axis, told from what goes with the position and from windows."""

from __future__ import annotations

import numpy as np
import pytest
from concealed_run import concealed_run
from diagnosis_runs import bench

import hil
from hil.diagnosis.search.disturbance import Disturbance, lines_hz
from hil.diagnosis.search.initial_values import axis_facts
from hil.identification.measured import take
from hil.recording.recording import Recording
from hil.twin.library import BY_ID

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


def test_lines_are_those_of_the_disturbance_over_time() -> None:
    run = take(recorded("constant_load", {"load_torque_n_m": 0.0}), OWNER)
    time_s = np.arange(run.motor.size) * run.period_s
    velocity = np.gradient(run.motor, run.period_s)
    torque = 1.1 * np.sign(velocity) + 0.3 * np.sin(2.0 * np.pi * 8.3 * time_s) + 0.1 * np.sin(40.0 * time_s)
    found = lines_hz(run, Disturbance(torque, velocity, np.abs(velocity) > 1e-3))
    assert found[0] == pytest.approx(8.3, abs=0.3 / time_s[-1])
    assert not lines_hz(run, Disturbance(torque, velocity, np.zeros(velocity.size, dtype=bool)))


def test_a_few_waves_in_the_whole_recording_are_a_drift() -> None:
    facts = axis_facts(OWNER, [take(recorded("constant_load", {"load_torque_n_m": 0.0}), OWNER)])
    for waves, told in ((8.0, True), (3.0, False)):
        assert MECHANISM.is_valid((10.0, waves / facts.duration_s, 0.0), 0, facts) is told
