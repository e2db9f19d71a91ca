"""Cascaded servo law: P position loop with velocity feed-forward around a PI velocity loop, sampled.

At tick k (period T; position loop when k % position_every == 0):

    v_ref = Kv (x_cmd - x_feedback) + ff v_cmd                         [m/s]
    e     = v_ref / r - v_meas                                         [rad/s]
    u     = clip(Kp e + I, +-limit);   I += Kp / Ti e T  unless |Kp e + I| >= limit

v_meas is the backward difference of the motor encoder, or the derivative of its two-sample mean
(q_k - q_k-2) / 2T, through an optional first-order filter. A linear axis: r = 1, metres and newtons.
"""

from dataclasses import dataclass, fields
from enum import StrEnum
from math import exp, isnan
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.port import ServoTarget


class VelocityEstimate(StrEnum):
    """Estimate of the velocity from the motor encoder."""

    BACKWARD_DIFFERENCE = "backward_difference"
    TWO_SAMPLE_MEAN = "two_sample_mean"


class PositionFeedback(StrEnum):
    """Encoder of the position loop."""

    MOTOR = "motor"
    TABLE = "table"


@dataclass(frozen=True)
class Servo:
    """Gains and options; defaults are the reference axis. velocity_integral_time_s = inf: P velocity loop.

    velocity_gain_n_m_s_rad and torque_limit_n_m are N s/m and N on a linear axis.
    """

    position_gain_1_s: float = 36.84
    velocity_feedforward: float = 1.0
    velocity_gain_n_m_s_rad: float = 0.26738
    velocity_integral_time_s: float = 0.0062
    torque_limit_n_m: float = 12.0
    position_every: int = 4
    velocity_filter_s: float = 0.0
    velocity_estimate: VelocityEstimate = VelocityEstimate.BACKWARD_DIFFERENCE
    feedback: PositionFeedback = PositionFeedback.MOTOR

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, (int, float)) and (isnan(value) or value < 0):
                raise ValueError(f"servo.{item.name}: must be >= 0, got {value!r}")
        if self.velocity_integral_time_s == 0 or self.position_every < 1:
            raise ValueError(
                "servo: velocity_integral_time_s must be > 0 (inf: no integrator) and position_every >= 1, "
                f"got {self.velocity_integral_time_s!r} and {self.position_every!r}"
            )


SERVO = np.dtype(
    [("position_every", np.int64), ("two_sample_mean", np.int64), ("table_feedback", np.int64)]
    + [
        (name, np.float64)
        for name in (
            "ratio", "period", "position_gain", "feedforward", "velocity_gain", "integral_step", "limit", "filter_pole"
        )
    ],
    align=True,
)  # fmt: skip
SERVO_STATE = np.dtype(
    [
        ("tick", np.int64), ("previous", np.float64), ("before_previous", np.float64), ("velocity", np.float64),
        ("reference", np.float64), ("integral", np.float64),
    ],
    align=True,
)  # fmt: skip


def pack_servo(servo: Servo, ratio_m_rad: float, period_s: float) -> NDArray[np.void]:
    """Array of one SERVO record; ratio_m_rad: travel per unit of motor position, 1 on a linear axis."""
    packed = np.zeros(1, SERVO)
    c: Any = packed[0]
    c["position_every"] = servo.position_every
    c["two_sample_mean"] = servo.velocity_estimate == VelocityEstimate.TWO_SAMPLE_MEAN
    c["table_feedback"] = servo.feedback == PositionFeedback.TABLE
    c["ratio"], c["period"] = ratio_m_rad, period_s
    c["position_gain"], c["feedforward"] = servo.position_gain_1_s, servo.velocity_feedforward
    c["velocity_gain"], c["limit"] = servo.velocity_gain_n_m_s_rad, servo.torque_limit_n_m
    c["integral_step"] = servo.velocity_gain_n_m_s_rad * period_s / servo.velocity_integral_time_s
    c["filter_pole"] = exp(-period_s / servo.velocity_filter_s) if servo.velocity_filter_s > 0 else 0.0
    return packed


@njit(cache=True)
def start_servo(s: Any, motor_position: float) -> None:
    """Set the state to rest at this motor position, with the integrator at zero."""
    s.tick = 0
    s.previous = s.before_previous = motor_position
    s.velocity = s.reference = s.integral = 0.0


@njit(cache=True)
def position_loop(c: Any, s: Any, command_m: float, command_m_s: float, motor_position: float, table_m: float) -> float:
    """Return v_ref [m/s], computed every position_every-th tick and held between."""
    if s.tick % c.position_every == 0:
        feedback = table_m if c.table_feedback else c.ratio * motor_position
        s.reference = c.position_gain * (command_m - feedback) + c.feedforward * command_m_s
    reference: float = s.reference
    return reference


@njit(cache=True)
def velocity_loop(c: Any, s: Any, reference_rad_s: float, motor_position: float) -> float:
    """Torque command; counts the tick."""
    if c.two_sample_mean:
        raw = (motor_position - s.before_previous) / (2.0 * c.period)
    else:
        raw = (motor_position - s.previous) / c.period
    s.before_previous, s.previous = s.previous, motor_position
    s.velocity = c.filter_pole * s.velocity + (1.0 - c.filter_pole) * raw
    error = reference_rad_s - s.velocity
    wanted: float = c.velocity_gain * error + s.integral
    if abs(wanted) < c.limit:
        s.integral += c.integral_step * error
    s.tick += 1
    limit: float = c.limit
    return min(max(wanted, -limit), limit)


@njit(cache=True)
def _drive_torque(
    c: np.ndarray, s: np.ndarray, velocity: float, position: float, use_position: bool, motor_position: float
) -> float:
    reference = velocity
    if use_position:
        ratio = c[0].ratio
        reference = position_loop(c[0], s[0], ratio * position, ratio * velocity, motor_position, 0.0) / ratio
    torque: float = velocity_loop(c[0], s[0], reference, motor_position)
    return torque


class DriveServo:
    """The loops inside a simulated drive (CSV: velocity, CSP: position and velocity), on the motor encoder."""

    def __init__(self, servo: Servo, ratio_m_rad: float) -> None:
        if servo.feedback != PositionFeedback.MOTOR:
            raise ValueError("servo.feedback: a drive sees its motor encoder only; must be motor, got table")
        self.servo, self._ratio_m_rad = servo, ratio_m_rad
        self._constants = pack_servo(servo, ratio_m_rad, 1e-3)
        self._state = np.zeros(1, SERVO_STATE)
        self._period_s = 1e-3

    def reset(self, motor_position_rad: float) -> None:
        """Set the state to rest at this motor position."""
        start_servo(self._state[0], motor_position_rad)

    def torque(self, target: ServoTarget, motor_position_rad: float, period_s: float) -> float:
        """Torque command [N m] for the next period."""
        if period_s != self._period_s:
            self._constants, self._period_s = pack_servo(self.servo, self._ratio_m_rad, period_s), period_s
        position = target.position_rad
        torque: float = _drive_torque(
            self._constants, self._state, target.velocity_rad_s, 0.0 if position is None else position,
            position is not None, motor_position_rad,
        )  # fmt: skip
        return torque
