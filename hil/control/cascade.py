"""Cascaded servo control: P position loop with velocity feed-forward around a PI velocity loop.

    position loop, every n-th tick   v_ref = Kv (x_cmd - x) + ff v_cmd                      [m/s]
    velocity loop, every tick        e = v_ref / r - v,   y = Kp e + I + u_ff,   u = clip(y, +-limit)
                                     I <- I + (Kp / Ti) e T unless |y| >= limit             [N m]

r = lead / 2 pi in m/rad (1 on a linear axis); v is a difference of the motor encoder. The current loop
is the torque constant, a gain (Sec. 2 of the source paper). `step` is pure and compiled: the live
loop, the simulation and the replay of a recording call this one function, so that replaying gives
the same bits.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hil.arrays import FloatArray
from hil.compiled.rounding import rounded

INFINITE = math.inf


class Gains(NamedTuple):
    """Constants of the control law; see the module's equations.

    Use `make_gains` to build one: it checks the values and works out the integral gain.
    """

    position_gain_1_s: float
    velocity_feedforward: float
    velocity_gain_n_m_s_rad: float
    integral_gain_n_m_rad: float  # Kp / Ti; 0 gives a P velocity loop
    torque_limit_n_m: float
    ratio_m_rad: float
    period_s: float
    position_ticks: int  # the position loop runs every so many ticks
    position_from_table: bool
    two_sample_mean: bool  # velocity as the difference of two-sample means of position
    filter_coefficient: float  # 1 - exp(-T/tau) of the velocity filter; 1 without one


class State(NamedTuple):
    """State of the controller between ticks."""

    tick: int
    velocity_reference_m_s: float
    integral_n_m: float
    previous_motor_rad: float
    previous2_motor_rad: float
    filtered_velocity_rad_s: float


class Inputs(NamedTuple):
    """Inputs of the controller at a tick."""

    position_command_m: float
    velocity_command_m_s: float
    motor_position_rad: float
    table_position_m: float
    torque_feedforward_n_m: float = 0.0  # u_ff, of a compensation


class Outputs(NamedTuple):
    """Commands: torque (CST), and velocity for drives that close the velocity loop (CSV)."""

    torque_n_m: float
    velocity_reference_m_s: float


def make_gains(
    *,
    position_gain_1_s: float,
    velocity_gain_n_m_s_rad: float,
    ratio_m_rad: float,
    velocity_feedforward: float = 1.0,
    velocity_integral_time_s: float | None = None,
    velocity_period_s: float = 0.001,
    position_period_s: float = 0.004,
    torque_limit_n_m: float = INFINITE,
    position_from_table: bool = False,
    two_sample_mean: bool = False,
    velocity_filter_time_constant_s: float = 0.0,
) -> Gains:
    """Build the gains of the law above from SI values.

    Raises ValueError where the position period is no whole multiple of the velocity period.
    """
    ticks = round(position_period_s / velocity_period_s)
    if ticks < 1 or abs(ticks * velocity_period_s - position_period_s) > 1e-9:
        raise ValueError(
            f"position_period_s must be a whole multiple of velocity_period_s = {velocity_period_s} s, "
            f"got {position_period_s} s"
        )
    filtered = velocity_filter_time_constant_s > 0.0
    return Gains(
        float(position_gain_1_s),
        float(velocity_feedforward),
        float(velocity_gain_n_m_s_rad),
        velocity_gain_n_m_s_rad / velocity_integral_time_s if velocity_integral_time_s else 0.0,
        float(torque_limit_n_m),
        float(ratio_m_rad),
        float(velocity_period_s),
        ticks,
        bool(position_from_table),
        bool(two_sample_mean),
        1.0 - math.exp(-velocity_period_s / velocity_filter_time_constant_s) if filtered else 1.0,
    )


def init(
    motor_position_rad: float,
    motor_velocity_rad_s: float = 0.0,
    torque_n_m: float = 0.0,
    period_s: float = 0.001,
    tick: int = 0,
) -> State:
    """Start a controller without a jump: motor at `motor_velocity_rad_s`, integrator at `torque_n_m`."""
    step_rad = motor_velocity_rad_s * period_s
    return State(
        tick,
        0.0,
        float(torque_n_m),
        float(motor_position_rad - step_rad),
        float(motor_position_rad - 2.0 * step_rad),
        float(motor_velocity_rad_s),
    )


@njit(cache=True, nogil=True, fastmath=False)
def step(gains: Gains, state: State, inputs: Inputs) -> tuple[State, Outputs]:
    """Compute one tick of the control law at the top of this module; pure."""
    reference = state.velocity_reference_m_s
    if state.tick % gains.position_ticks == 0:
        if gains.position_from_table:
            position = inputs.table_position_m
        else:
            position = rounded(gains.ratio_m_rad * inputs.motor_position_rad)
        reference = rounded(gains.position_gain_1_s * (inputs.position_command_m - position)) + rounded(
            gains.velocity_feedforward * inputs.velocity_command_m_s
        )
    motor = inputs.motor_position_rad
    if gains.two_sample_mean:
        velocity = (motor - state.previous2_motor_rad) / (2.0 * gains.period_s)
    else:
        velocity = (motor - state.previous_motor_rad) / gains.period_s
    if gains.filter_coefficient < 1.0:
        velocity = state.filtered_velocity_rad_s + rounded(
            gains.filter_coefficient * (velocity - state.filtered_velocity_rad_s)
        )
    error = reference / gains.ratio_m_rad - velocity
    wanted = rounded(gains.velocity_gain_n_m_s_rad * error) + state.integral_n_m
    if inputs.torque_feedforward_n_m != 0.0:  # -0 + 0 is another bit
        wanted += inputs.torque_feedforward_n_m
    limit = gains.torque_limit_n_m
    integral = state.integral_n_m
    if abs(wanted) < limit:
        integral += rounded(gains.integral_gain_n_m_rad * error * gains.period_s)
    torque = min(max(wanted, -limit), limit)
    after = State(state.tick + 1, reference, integral, motor, state.previous_motor_rad, velocity)
    return after, Outputs(torque, reference)


@njit(cache=True, nogil=True, fastmath=False)
def replay(
    gains: Gains,
    state: State,
    position_command_m: FloatArray,
    velocity_command_m_s: FloatArray,
    motor_position_rad: FloatArray,
    table_position_m: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Compute torque and velocity reference (n,) of the controller from measured positions (n,)."""
    n = motor_position_rad.size
    torque = np.empty(n)
    reference = np.empty(n)
    for k in range(n):
        inputs = Inputs(position_command_m[k], velocity_command_m_s[k], motor_position_rad[k], table_position_m[k], 0.0)
        state, outputs = step(gains, state, inputs)
        torque[k] = outputs.torque_n_m
        reference[k] = outputs.velocity_reference_m_s
    return torque, reference
