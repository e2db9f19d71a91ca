"""An eccentric encoder of a load that turns, found on a simulated geared axis."""

from __future__ import annotations

import math

import pytest
from geared_axis import geared

import hil
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.twin.library import BY_ID

pytestmark = pytest.mark.net

MECHANISM = BY_ID["load_encoder_eccentricity"]


def test_an_eccentric_encoder_of_the_load_is_found() -> None:
    amplitude_rad, phase_rad = 3e-4, 1.1
    parameters = {"amplitude_rad": amplitude_rad, "phase_rad": phase_rad}
    truth = geared({"effect": MECHANISM.id, "parameters": parameters})
    move = {"kind": "sine_squared", "feed_m_s": 4.0}
    legs = [{"kind": "dwell", "duration_s": 0.3}, move | {"to_m": 9.0}, move | {"to_m": 0.0, "feed_m_s": 2.0}]
    profile = Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 6.0, "acceleration_m_s2": 30.0, "jerk_m_s3": 600.0},
            "segments": [{"kind": "repeat", "times": 1, "segments": legs}],
        }
    )
    recording = hil.simulate(truth, plan(profile, truth.period_s), seed=3)
    result = hil.diagnose(recording, truth.model_copy(update={"simulation": None})).result
    (finding,) = result.missing
    assert "The load encoder, or the wheel that turns the load, sits off centre" in result.statement
    assert result.location.period_m == pytest.approx(2.0 * math.pi)  # not a turn of the motor
    assert finding.effect == MECHANISM.id
    assert finding.parameters["amplitude_rad"].value == pytest.approx(amplitude_rad, rel=0.02)
    assert finding.parameters["phase_rad"].value == pytest.approx(phase_rad, abs=0.02)
