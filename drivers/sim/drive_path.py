"""Drive path from torque command to motor shaft: delay, limit, dead zone, lag, torque constant, cogging."""

from math import exp, sin, sqrt
from typing import Any

from numba import njit

from drivers.sim.contact import ramp
from drivers.sim.layout import COMMAND_LINE, delayed, push


@njit(cache=True)
def clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


@njit(cache=True)
def lag(value: float, output: float, ratio: float) -> tuple[float, float]:
    """Mean over one step and end of y' = (value - y) / tau from y = output; ratio = step / tau."""
    gain = 1.0 - exp(-ratio)
    return value + (output - value) * gain / ratio, output + gain * (value - output)


@njit(cache=True)
def drive_torque(p: Any, s: Any, lines: Any, command: float) -> tuple[float, float]:
    """Measured current (x nominal torque constant) and torque of the drive for a command, both in the motor's unit.

    delay -> limit -> dead zone -> first-order lag. Form 1 (hidden): the current does not show that stage.
    """
    current = torque = command
    e = p.transport_delay
    if e.on:
        push(lines[COMMAND_LINE], s.tick, command)
        torque = delayed(lines[COMMAND_LINE], s.tick, e.delay_s / p.step_s)
        if e.form == 0:
            current = torque
    if p.torque_saturation.on:
        limit = p.torque_saturation.limit_n_m
        torque = clip(torque, limit)
        if p.torque_saturation.form == 0:
            current = clip(current, limit)
    if p.torque_dead_zone.on:
        width = p.torque_dead_zone.half_width_n_m
        torque -= clip(torque, width)
        if p.torque_dead_zone.form == 0:
            current -= clip(current, width)
    if p.current_loop_lag.on:
        ratio = p.step_s / p.current_loop_lag.time_constant_s
        torque, s.lag_torque = lag(torque, s.lag_torque, ratio)
        if p.current_loop_lag.form == 0:
            current, s.lag_current = lag(current, s.lag_current, ratio)
    return current, torque


@njit(cache=True)
def angle_torque(p: Any, torque: float, angle: float, position_m: float, time_s: float) -> float:
    """Torque of the motor from its current: saturated, drifting or sloping torque constant, ripple, cogging."""
    saturation = p.torque_constant_saturation.coefficient_1_n2_m2
    if saturation > 0.0:
        u = clip(torque, 1.0 / sqrt(3.0 * saturation))  # u (1 - c u^2) is greatest here
        torque = u * (1.0 - saturation * u * u)
    d = p.torque_constant_drift
    if d.on:
        torque *= 1.0 + d.fraction * (1.0 - exp(-time_s / d.time_constant_s))
    if p.torque_constant_gradient.on:
        torque += torque * max(p.torque_constant_gradient.slope_1_m * position_m, -1.0)
    if p.local_torque_constant.on:
        z = p.local_torque_constant
        torque *= 1.0 + z.fraction * ramp((position_m - z.begin_m) / z.flank_m) * ramp(
            (z.end_m - position_m) / z.flank_m
        )
    e = p.torque_ripple
    torque *= 1.0 + e.fraction * sin(e.cycles_per_rev * angle + e.phase_rad)
    g = p.cogging_torque
    torque += g.amplitude_n_m * sin(g.cycles_per_rev * angle + g.phase_rad)
    return torque
