"""An eccentric encoder of a load that turns: found on a simulated geared axis, offered only where it can be."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.search.initial_values import axis_facts, observable
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.twin.library import BY_ID

MECHANISM = BY_ID["load_encoder_eccentricity"]
CONTROL = {
    "position_gain_1_s": 20.0,
    "velocity_gain_n_m_s_rad": 0.3,
    "velocity_integral_time_s": 0.02,
    "velocity_feedforward": 1.0,
}
AXIS = {
    "model": "rotary_two_mass",
    "gear_ratio": 10.0,
    "motor_inertia_kg_m2": 1e-3,
    "load_inertia_kg_m2": 0.2,
    "stiffness_n_m_rad": 2e5,
    "coulomb_torque_n_m": 0.3,
    "viscous_torque_n_m_s_rad": 1e-3,
}


def geared(effects: list[dict[str, object]]) -> Bench:
    """A geared axis whose law is known, with effects of the simulated axis."""
    data = load_bench("rotary_geared").model_dump(mode="json")
    return Bench.model_validate(
        data
        | {
            "axis": AXIS,
            "control": CONTROL,
            "simulation": {"effects": effects},
            "drive": {"following_error_m": 1.0},
        }
    )


@pytest.mark.long
def test_an_eccentric_encoder_of_the_load_is_found() -> None:
    amplitude_rad, phase_rad = 3e-4, 1.1
    parameters = {"amplitude_rad": amplitude_rad, "phase_rad": phase_rad}
    truth = geared([{"effect": MECHANISM.id, "parameters": parameters}])
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
    assert "The load encoder sits off centre" in result.statement
    assert result.location.period_m == pytest.approx(2.0 * math.pi)  # not a turn of the motor
    assert finding.effect == MECHANISM.id
    assert finding.parameters["amplitude_rad"].value == pytest.approx(amplitude_rad, rel=0.02)
    assert finding.parameters["phase_rad"].value == pytest.approx(phase_rad, abs=0.02)


def test_it_is_offered_only_for_an_encoder_on_a_load_that_turns() -> None:
    (variant,) = MECHANISM.variants
    one_encoder = load_bench("rotary")
    assert observable(MECHANISM, variant, geared([]))
    assert not observable(MECHANISM, variant, one_encoder)
    assert MECHANISM.turning  # not on an axis whose load moves along a line
    facts = axis_facts(geared([]).sampled(1e-3))
    for travel_m, told in ((7.0, True), (6.0, False)):
        assert MECHANISM.is_valid((1e-3, 0.0), 0, replace(facts, travel_m=travel_m)) is told
