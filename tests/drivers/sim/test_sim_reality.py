"""The servo law against a plain one written here, closed-loop recordings, and recordings of another simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sim_tools import PERFECT, motion

from drivers.port import ServoTarget
from drivers.sim.axis import AxisTruth, one_mass, seven_dof, two_mass
from drivers.sim.effects import Effect
from drivers.sim.plant import Plant
from drivers.sim.reality import record
from drivers.sim.sensors import Sensors
from drivers.sim.servo import DriveServo, PositionFeedback, Servo, VelocityEstimate

R = 0.01 / (2 * np.pi)


class PlainServo:
    """The law in plain Python."""

    def __init__(self, servo: Servo, ratio: float, period_s: float, start: float) -> None:
        self.servo, self.ratio, self.period_s = servo, ratio, period_s
        self.history, self.reference, self.integral, self.velocity = [start, start], 0.0, 0.0, 0.0

    def torque(self, k: int, x: float, v: float, motor: float, table: float) -> float:
        s, T = self.servo, self.period_s
        if k % s.position_every == 0:
            seen = table if s.feedback == "table" else self.ratio * motor
            self.reference = s.position_gain_1_s * (x - seen) + s.velocity_feedforward * v
        if s.velocity_estimate == "two_sample_mean":
            now, last = (motor + self.history[-1]) / 2, (self.history[-1] + self.history[-2]) / 2
        else:
            now, last = motor, self.history[-1]
        self.history.append(motor)
        raw = (now - last) / T
        keep = np.exp(-T / s.velocity_filter_s) if s.velocity_filter_s else 0.0
        self.velocity = keep * self.velocity + (1 - keep) * raw
        e = self.reference / self.ratio - self.velocity
        wanted = s.velocity_gain_n_m_s_rad * e + self.integral
        if abs(wanted) < s.torque_limit_n_m:
            self.integral += s.velocity_gain_n_m_s_rad / s.velocity_integral_time_s * e * T
        return float(np.clip(wanted, -s.torque_limit_n_m, s.torque_limit_n_m))


EMPS = Servo(
    position_gain_1_s=160.18, velocity_feedforward=0.0, velocity_gain_n_m_s_rad=243.45 * 35.15065,
    velocity_integral_time_s=np.inf, torque_limit_n_m=1e4, position_every=1,
    velocity_estimate=VelocityEstimate.TWO_SAMPLE_MEAN,
)  # fmt: skip


@pytest.mark.parametrize(("axis", "servo"), [
    (two_mass(), Servo()),
    (two_mass(), Servo(torque_limit_n_m=2.0)),
    (two_mass(), Servo(feedback=PositionFeedback.TABLE, position_every=1, velocity_filter_s=5e-4)),
    (seven_dof(), Servo(velocity_estimate=VelocityEstimate.TWO_SAMPLE_MEAN)),
    (one_mass(), EMPS),
])  # fmt: skip
def test_recording_is_the_plant_under_the_plain_law(axis: AxisTruth, servo: Servo) -> None:
    position, velocity = motion(1.2)
    sensors = Sensors(motor_counts_per_rev=50_000)
    rows = record(axis, sensors, [], servo, position, velocity, seed=3)
    plant = Plant(axis, sensors, seed=3)
    plain = PlainServo(servo, axis.drive_ratio_m_rad, 1e-3, plant.motor_position_rad)
    by_hand = []
    for k, (x, v) in enumerate(zip(position, velocity, strict=True)):
        motor, table = plant.motor_position_rad, plant.table_position_m
        command = plain.torque(k, x, v, motor, table)
        plant.advance(command, 1e-3)
        by_hand.append((motor, command, plant.torque_n_m))
    names = ("motor_position_m", "force_command_n", "force_n") if axis.linear else (
        "motor_position_rad", "torque_command_n_m", "torque_n_m")  # fmt: skip
    for name, values in zip(names, np.array(by_hand).T, strict=True):
        assert rows[name] == pytest.approx(values, rel=1e-6, abs=1e-6 * np.ptp(values))


def test_channels_are_the_canonical_ones() -> None:
    position, velocity = motion(0.5)
    rows = record(two_mass(), None, [], Servo(), position, velocity)
    assert list(rows) == [
        "time_s", "position_command_m", "velocity_command_m_s", "motor_position_rad", "table_position_m",
        "torque_command_n_m", "torque_n_m",
    ]  # fmt: skip
    assert all(values.shape == (500,) for values in rows.values())
    assert rows["time_s"][-1] == pytest.approx(0.499)
    assert "table_position_m" not in record(one_mass(), None, [], EMPS, position, velocity)
    with pytest.raises(ValueError, match="same length"):
        record(two_mass(), None, [], Servo(), position, velocity[:-1])


def test_same_seed_same_recording() -> None:
    position, velocity = motion(0.6)
    first, again, other = (record(two_mass(), None, [], Servo(), position, velocity, seed=s) for s in (5, 5, 6))
    for channel, values in first.items():
        assert np.array_equal(values, again[channel])
    assert np.array_equal(first["motor_position_rad"], other["motor_position_rad"])  # torque noise is only measured
    assert np.std(first["torque_n_m"] - other["torque_n_m"]) == pytest.approx(0.01 * np.sqrt(2), rel=0.1)


def test_starts_at_rest_on_the_first_set_point() -> None:
    effects = [Effect("periodic_lead_error", {"amplitude_m": 5e-6, "phase_rad": 1.0})]
    rows = record(two_mass(), PERFECT, effects, Servo(), np.full(300, 0.0523), np.zeros(300))
    assert np.all(rows["motor_position_rad"] == rows["motor_position_rad"][0])
    assert rows["motor_position_rad"][0] * R == pytest.approx(0.0523)
    assert np.all(rows["table_position_m"] == rows["table_position_m"][0])


def test_concealed_velocity_filter_is_the_filter_of_the_servo() -> None:
    position, velocity = motion(0.6)
    hidden = Effect("velocity_filter_lag", {"time_constant_s": 1e-3})
    concealed = record(two_mass(), None, [hidden], Servo(), position, velocity)
    stated = record(two_mass(), None, [], Servo(velocity_filter_s=1e-3), position, velocity)
    assert all(np.array_equal(concealed[channel], stated[channel]) for channel in stated)


def test_drive_servo_follows_velocity_and_position() -> None:
    """CSV and CSP: the loops inside the drive, target by target."""
    plant, servo = Plant(two_mass(), PERFECT), DriveServo(Servo(), R)
    servo.reset(plant.motor_position_rad)
    for _ in range(600):
        plant.advance(servo.torque(ServoTarget(20.0), plant.motor_position_rad, 1e-3), 1e-3)
    assert plant.motor_velocity_true_rad_s == pytest.approx(20.0, rel=1e-3)
    hold = plant.motor_position_rad + 5.0
    for _ in range(2000):
        plant.advance(servo.torque(ServoTarget(0.0, hold), plant.motor_position_rad, 1e-3), 1e-3)
    assert plant.motor_position_rad == pytest.approx(hold, abs=1e-3)
    with pytest.raises(ValueError, match="must be motor"):
        DriveServo(Servo(feedback=PositionFeedback.TABLE), R)


def test_servo_refuses_nonsense() -> None:
    with pytest.raises(ValueError, match="velocity_integral_time_s must be > 0"):
        replace(Servo(), velocity_integral_time_s=0.0)
    with pytest.raises(ValueError, match=r"servo.torque_limit_n_m: must be >= 0"):
        replace(Servo(), torque_limit_n_m=-1.0)
