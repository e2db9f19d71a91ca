"""Rotary axes: inertias, gear and spring reduced to the motor, and a recording of one of them diagnosed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hil
from hil.bench.axis_models import model_of
from hil.bench.bench_file import Bench, load_bench
from hil.bench.turning_axes import DcMotor, Rotary, RotaryTwoMass
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.twin.structure.modal import modal

FRICTION = {"coulomb_torque_n_m": 0.1, "viscous_torque_n_m_s_rad": 0.002}


def test_one_inertia_stands_at_the_motor() -> None:
    axis = Rotary(inertia_kg_m2=2e-3, gear_ratio=50.0, **FRICTION)
    assert axis.physics().chain.inertia_kg_m2 == pytest.approx(np.array([[2e-3]]))
    assert axis.ratio_m_rad == pytest.approx(1.0 / 50.0)
    assert not axis.linear


def test_the_load_is_reduced_by_the_square_of_the_gear() -> None:
    axis = RotaryTwoMass(
        motor_inertia_kg_m2=1e-3, load_inertia_kg_m2=15.0, stiffness_n_m_rad=2e5, gear_ratio=100.0, **FRICTION
    )
    chain = axis.physics().chain
    assert np.diag(chain.inertia_kg_m2) == pytest.approx([1e-3, 1.5e-3])
    # free oscillation of two inertias: w^2 = k (1 / J1 + 1 / J2), all at the motor
    expected = math.sqrt(20.0 * (1.0 / 1e-3 + 1.0 / 1.5e-3))
    assert modal(chain).frequency_rad_s[1] == pytest.approx(expected, rel=1e-9)


def test_a_voltage_drives_a_dc_motor_like_a_torque() -> None:
    """R, Kt = Ke, J and D of a motor give its volts, and its speed under a step of the voltage."""
    resistance, constant, inertia, drag, friction = 2.0, 0.05, 1e-4, 2e-4, 0.01
    slope = constant + resistance * drag / constant
    axis = DcMotor(
        time_constant_s=resistance * inertia / (constant * slope),
        coulomb_voltage_v=resistance * friction / constant,
        voltage_constant_v_s_rad=slope,
    )
    period_s, volts = 1e-3, 12.0
    bench = Bench.model_validate({"axis": axis.model_dump(), "control": {"law": "unknown"}}).sampled(period_s)
    driven = bench.twin().drive(np.full(400, volts))
    # J a = Kt (u - Ke w) / R - D w - Tc
    stall = constant * volts / resistance - friction
    per_speed = constant**2 / resistance + drag
    time_s = period_s * np.arange(400)
    lag_s = inertia / per_speed
    expected = stall / per_speed * (time_s - lag_s * (1.0 - np.exp(-time_s / lag_s)))
    # friction is constant over an internal step of 0.2 ms, 0.3 % of the lag
    assert driven.motor_position == pytest.approx(expected, rel=3e-3, abs=1e-4)


def test_keys_tell_the_kind_of_axis() -> None:
    assert model_of({"coulomb_voltage_v", "time_constant_s", "voltage_constant_v_s_rad"}) == "dc_motor"
    assert model_of({"inertia_kg_m2"}) == "rotary"
    assert model_of({"motor_inertia_kg_m2", "load_inertia_kg_m2"}) == "rotary_two_mass"


def test_a_rotary_axis_is_simulated_and_diagnosed_without_its_law() -> None:
    control = {
        "position_gain_1_s": 20.0,
        "velocity_gain_n_m_s_rad": 0.2,
        "velocity_integral_time_s": 0.02,
        "velocity_feedforward": 1.0,
    }
    data = load_bench("rotary").model_dump(mode="json") | {
        "control": control,
        "simulation": {},
        "drive": {"following_error_m": 1.0},
    }
    truth = Bench.model_validate(data)
    move = {"kind": "sine_squared", "feed_m_s": 6.0}
    legs = [{"kind": "dwell", "duration_s": 0.2}, move | {"to_m": 4.0}, move | {"to_m": 0.0, "feed_m_s": 2.0}]
    profile = Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 10.0, "acceleration_m_s2": 60.0, "jerk_m_s3": 3000.0},
            "segments": [{"kind": "repeat", "times": 4, "segments": legs}],
        }
    )
    recording = hil.simulate(truth, plan(profile, truth.period_s), seed=3)
    axis = truth.axis.model_copy(update={"inertia_kg_m2": 2.6e-3, "coulomb_torque_n_m": 0.14})
    owner = load_bench("rotary").model_copy(update={"axis": axis})
    result = hil.diagnose(recording, owner).result
    assert result.verdict == "parameter_error"
    assert result.parameter_corrections["inertia_kg_m2"].value == pytest.approx(2e-3, rel=0.01)
    assert result.parameter_corrections["coulomb_torque_n_m"].value == pytest.approx(0.1, rel=0.02)
