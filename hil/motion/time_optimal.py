"""Time-optimal motion by ruckig: approach, jog, and stops from any state.

Its trajectories have the jerk -J, 0 or +J; each section becomes one Cubic piece, so that set-points are
evaluated in closed form like those of every other move. (Berscheid, Kroeger: Jerk-limited real-time
trajectory generation with arbitrary target states, RSS 2021.)

A starting velocity or acceleration beyond its limit is allowed: it is brought back within the limit in the
shortest time, and both limits hold from then on. The jerk limit always holds.
"""

import math
from typing import NamedTuple

import ruckig

from hil.errors import FieldError, HilError, InputError
from hil.motion.pieces import Cubic, MotionLimits, Move, Piece, end_m

END_TOLERANCE_M = 1e-10


class MotionState(NamedTuple):
    """State in which a motion starts."""

    position_m: float
    velocity_m_s: float = 0.0
    acceleration_m_s2: float = 0.0


def point_to_point(start_m: float, target_m: float, limits: MotionLimits) -> Move:
    """Time-optimal motion from rest to rest at target_m.

    Raises InputError for a number that is not finite, HilError if ruckig finds no trajectory.
    """
    order = _order(MotionState(start_m), limits)
    order.target_position = [_finite("target_m", target_m)]
    pieces = _solve(order)
    # ruckig itself accepts 1e-8 m; a second, tiny move closes the remaining distance
    if pieces and abs(end_m(pieces[-1]) - target_m) > END_TOLERANCE_M * max(1.0, abs(target_m)):
        pieces += point_to_point(end_m(pieces[-1]), target_m, limits).pieces
    return Move(pieces, target_m)


def stop(state: MotionState, limits: MotionLimits) -> Move:
    """Shortest way to rest from any state, wherever that is. Raises as point_to_point."""
    return velocity_step(state, 0.0, limits)


def velocity_step(state: MotionState, velocity_m_s: float, limits: MotionLimits) -> Move:
    """Time-optimal change from any state to a constant velocity; ends moving. Raises as point_to_point."""
    order = _order(state, limits)
    order.control_interface = ruckig.ControlInterface.Velocity
    order.target_velocity = [_finite("velocity_m_s", velocity_m_s)]
    pieces = _solve(order)
    return Move(pieces, end_m(pieces[-1]) if pieces else state.position_m)


def jog(start_m: float, velocity_m_s: float, duration_s: float, limits: MotionLimits) -> Move:
    """Velocity for a duration, counted from rest to the beginning of the stop, as a jog key is held.

    Raises FieldError when the velocity is not reached within the duration.
    """
    speed_up = velocity_step(MotionState(start_m), velocity_m_s, limits)
    constant_s = duration_s - speed_up.duration_s
    if constant_s < 0:
        raise FieldError(
            ("duration_s",),
            f"given {duration_s:.6g} s, allowed at least {speed_up.duration_s:.6g} s "
            f"to reach {velocity_m_s:.6g} m/s; raise it or lower the velocity",
        )
    constant = Cubic(constant_s, speed_up.end_m, velocity_m_s)
    slow_down = stop(MotionState(end_m(constant), velocity_m_s), limits)
    return Move((*speed_up.pieces, constant, *slow_down.pieces), slow_down.end_m)


def _order(state: MotionState, limits: MotionLimits) -> ruckig.InputParameter:
    order = ruckig.InputParameter(1)
    order.current_position = [_finite("position_m", state.position_m)]
    order.current_velocity = [_finite("velocity_m_s", state.velocity_m_s)]
    order.current_acceleration = [_finite("acceleration_m_s2", state.acceleration_m_s2)]
    order.max_velocity = [limits.velocity_m_s]
    order.max_acceleration = [limits.acceleration_m_s2]
    order.max_jerk = [limits.jerk_m_s3]
    return order


def _solve(order: ruckig.InputParameter) -> tuple[Piece, ...]:
    trajectory = ruckig.Trajectory(1)
    try:
        solved = ruckig.Ruckig(1).calculate(order, trajectory) in (ruckig.Result.Working, ruckig.Result.Finished)
    except ruckig.RuckigError:
        solved = False
    if not solved:
        limits = f"{order.max_velocity[0]:g} m/s, {order.max_acceleration[0]:g} m/s^2, {order.max_jerk[0]:g} m/s^3"
        raise HilError(f"ruckig finds no trajectory within {limits}")
    profile = trajectory.profiles[0][0]
    return tuple(
        Cubic(t, p, v, a, j)
        for part in (profile.brake, profile)
        for t, p, v, a, j in zip(part.t, part.p, part.v, part.a, part.j, strict=False)
        if t > 0
    )


def _finite(name: str, value: float) -> float:
    if not math.isfinite(value):
        raise InputError(f"{name}: given {value}, allowed a finite number; correct it")
    return value
