"""Compiled step of the twin: modal states, friction, active mechanisms; and the readings of its encoders.

Each internal step h moves every modal oscillator exactly under the torques held over the step (Eq. 8 of the source),
then applies contact friction as an impulse. Position-dependent torques are taken at the predicted middle of the step,
which makes them second order. While the motor is slow the step is fine, for the reversals; else it is coarse.
"""

from typing import Any

from numba import njit

from hil.twin.stepping import stages
from hil.twin.stepping.contact import COMPILE, Resistance
from hil.twin.stepping.contact import rigid as _rigid
from hil.twin.stepping.friction import friction as _friction
from hil.twin.stepping.friction import under as _under
from hil.twin.stepping.records import coupling_of, shapes_of, step_of
from hil.twin.stepping.transmission import AxisMotion, along, follow, moment
from hil.twin.stepping.transmission import transmit as _transmit

_current, _torque, _motor_torque = stages.current, stages.torque, stages.motor_torque
_table_force, _motor_reading, _table_reading = stages.table_force, stages.motor_reading, stages.table_reading
_Effects = stages.Effects
# A motor slower than this sticks: the rest of its speed is rounding, on which the step size must not depend.
RESTING = 1e-9
# `_nrt=False` leaves out the counting of references to arrays, `forceinline` the handing over of arrays: both cost more
# than the mathematics of a step.
_KERNEL: Any = {"cache": True, "nogil": True, "_nrt": False, "forceinline": True, **COMPILE}
_PART: Any = {"_nrt": False, "forceinline": True, **COMPILE}


@njit(**_PART)
def _look(shapes, delta):  # type: ignore[no-untyped-def]
    """Position and velocity of motor, table and transmission spring."""
    position = speed = table = table_speed = stretch = stretch_rate = 0.0
    for i in range(delta.shape[1]):
        d, v = delta[0, i], delta[1, i]
        position += shapes.motor[i] * d
        speed += shapes.motor[i] * v
        table += shapes.table[i] * d
        table_speed += shapes.table[i] * v
        stretch += shapes.spring[i] * d
        stretch_rate += shapes.spring[i] * v
    return AxisMotion(position, speed, table, table_speed, stretch, stretch_rate)


@njit(**_PART)
def _move(shapes, step, coupled, coupling, drive, push, force, delta):  # type: ignore[no-untyped-def]
    """Move the modes by one step without friction; velocities of motor and table after it."""
    positions, velocities = delta[0], delta[1]
    free = table_free = 0.0
    for i in range(delta.shape[1]):
        g = (
            shapes.motor[i] * (drive + force.motor)
            + shapes.table[i] * push
            + shapes.spring[i] * force.spring
            + shapes.damper[i] * force.damper
            + shapes.screw[i] * force.screw
        )
        if coupled:
            g -= along(coupling[i], velocities)
        d, v = positions[i], velocities[i]
        positions[i] = step.a11[i] * d + step.a12[i] * v + step.b1[i] * g
        moved = step.a21[i] * d + step.a22[i] * v + step.b2[i] * g
        velocities[i] = moved
        free += shapes.motor[i] * moved
        table_free += shapes.table[i] * moved
    return free, table_free


@njit(**_PART)
def _move_driven(shapes, step, drive, delta):  # type: ignore[no-untyped-def]
    """Move the modes by one step under the motor torque alone; velocity of the motor after it."""
    positions, velocities = delta[0], delta[1]
    free = 0.0
    for i in range(delta.shape[1]):
        g = shapes.motor[i] * drive
        d, v = positions[i], velocities[i]
        positions[i] = step.a11[i] * d + step.a12[i] * v + step.b1[i] * g
        moved = step.a21[i] * d + step.a22[i] * v + step.b2[i] * g
        velocities[i] = moved
        free += shapes.motor[i] * moved
    return free


@njit(**_KERNEL)
def advance(command, constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
    """Move the axis by one control period under a held torque command; mean measured torque."""
    c, own, shapes, coupling = constants[0], memory[0], shapes_of(modes), coupling_of(modes)
    effects = _Effects(values, codes[0], own.mechanisms)
    any_active = c.any_active > 0
    motion = AxisMotion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if any_active:
        motion = _look(shapes, delta)
        speed = motion.speed
    else:
        speed = along(shapes.motor, delta[1])
    reversing = abs(speed) < c.slow_velocity + 2.0 * abs(speed - own.last_speed)
    fine = c.always_fine > 0 or (reversing and abs(speed) > RESTING)
    own.last_speed = speed
    step, internal = step_of(modes, fine), c.fine if fine else c.coarse
    steps, gain = internal.number, internal.motor_gain
    h = c.period / steps
    resistance = Resistance(c.coulomb, c.viscous, 0.0, 0.0)
    measured = 0.0
    for j in range(steps):
        made, guide = command, 0.0
        if any_active:
            middle = motion.position + 0.5 * h * motion.speed
            table_m = (motion.table + 0.5 * h * motion.table_speed) * c.ratio
            at = moment(c, own.clock + j * h, j * h, h, middle, motion.speed, table_m)
            made = _current(command, at, effects)
            turned = _torque(made, at, effects)
            drive = _motor_torque(turned, at, effects)
            push = _table_force(own.push, at, effects) * c.ratio
            force = _transmit(c, own, shapes, motion, at, effects, delta)
            free, table_free = _move(shapes, step, c.coupled, coupling, drive, push, force, delta)
            loaded = _under(at, turned, motion.speed)
            motor, guide = _friction(c, own, internal, motion, loaded, effects, free, table_free)
        else:
            free = _move_driven(shapes, step, command, delta)
            motor = _rigid(free, gain, resistance)
        measured += made
        for i in range(delta.shape[1]):
            g = shapes.motor[i] * motor + shapes.table[i] * guide
            delta[0, i] -= step.b1[i] * g
            delta[1, i] -= step.b2[i] * g
        if any_active and j + 1 < steps:
            motion = _look(shapes, delta)
    own.clock += c.period
    return measured / steps


@njit(**_KERNEL)
def read(constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
    """Read the two encoders: motor position (rad, or m) and table position (m)."""
    c, own, shapes = constants[0], memory[0], shapes_of(modes)
    effects = _Effects(values, codes[0], own.mechanisms)
    position, table = along(shapes.motor, delta[0]), along(shapes.table, delta[0]) * c.ratio
    at = moment(c, own.clock, 0.0, 0.0, position, 0.0, table)
    if c.rigid > 0 and effects.codes.transmission:
        table = follow(own, position, at, effects) * c.ratio
    return _motor_reading(position, at, effects), _table_reading(table, at, effects)
