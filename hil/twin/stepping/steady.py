"""Torque of an axis in steady motion: what a constant speed through a place needs, from the stages of the twin.

    needed   u = drive^-1 (T0 + sign Fc + drag + c v - table force x ratio - other torque on the motor)

Late and hysteretic effects are at their begin: each place is asked with an empty memory.
"""

import numpy as np
from numba import njit

from hil.twin.stepping import stages
from hil.twin.stepping.contact import COMPILE
from hil.twin.stepping.friction import level, under
from hil.twin.stepping.kernel import read
from hil.twin.stepping.records import shapes_of
from hil.twin.stepping.static_equilibrium import settle
from hil.twin.stepping.transmission import moment

_scale, _viscous_scale, _bias = stages.friction_scale, stages.viscous_scale, stages.bias
_share, _viscous_share = stages.table_share, stages.table_viscous_share
_current, _torque, _motor_torque, _table_force = stages.current, stages.torque, stages.motor_torque, stages.table_force
_Effects = stages.Effects
INVERSIONS, INVERTED = 30, 1e-9  # of the drive, whose torque constant may vary by half of itself: steps, error


@njit(cache=True, nogil=True, **COMPILE)
def steady(positions, speed, time_s, constants, modes, values, codes, memory):  # type: ignore[no-untyped-def]
    """Torque command that a speed needs at motor positions (n,), and the part of friction on the table (n,)."""
    c, own = constants[0], memory[0]
    effects = _Effects(values, codes[0], own.mechanisms)
    needed, on_table = np.empty(positions.size), np.empty(positions.size)
    sign = 1.0 if speed > 0.0 else -1.0 if speed < 0.0 else 0.0
    for k in range(positions.size):
        own.mechanisms[:] = 0.0
        at = moment(c, time_s, 0.0, c.period, positions[k], speed, positions[k] * c.ratio)
        scale = max(_scale(1.0, at, effects), 0.0)
        share = _share(0.0, at, effects)
        viscous_share = _viscous_share(share, at, effects)
        every = scale * max(_viscous_scale(1.0, at, effects), 0.0) * c.viscous
        viscous = every * speed
        moved = _bias(0.0, at, effects) + viscous - _table_force(0.0, at, effects) * c.ratio
        other, goal, sliding = _motor_torque(0.0, at, effects), moved, 0.0
        for _ in range(INVERSIONS):  # friction may grow with the torque that it is part of: Steffensen's method
            bound, drag = level(c, scale, every, under(at, goal - other, speed), effects)
            sliding = sign * bound + drag
            once = moved + sliding
            if abs(once - goal) <= INVERTED * abs(once):
                break
            bound, drag = level(c, scale, every, under(at, once - other, speed), effects)
            twice = moved + sign * bound + drag
            bent = twice - 2.0 * once + goal
            goal = goal - (once - goal) ** 2 / bent if bent != 0.0 else twice
        on_table[k] = share * sliding + viscous_share * viscous
        command = goal
        for _ in range(INVERSIONS):
            own.mechanisms[:] = 0.0
            made = _motor_torque(_torque(_current(command, at, effects), at, effects), at, effects)
            command += goal - made
            if abs(goal - made) <= INVERTED * abs(goal):
                break
        needed[k] = command
    return needed, on_table


@njit(cache=True, nogil=True, **COMPILE)
def at_rest(positions, pushes, stroke, constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
    """Readings of motor and table (n,) at rest with the motor at positions (n,) under pushes (n,) on the table [N].

    The table of a rigid axis is pulled there from `stroke` away [motor units].
    """
    own, motor, table = memory[0], np.empty(positions.size), np.empty(positions.size)
    shape = shapes_of(modes).motor[0]
    for k in range(positions.size):
        delta[:] = 0.0
        delta[0, 0] = positions[k] / shape
        own.mechanisms[:] = 0.0
        own.push = pushes[k]
        settle(constants, modes, values, codes, delta, memory)
        own.carried = positions[k] - stroke
        motor[k], table[k] = read(constants, modes, values, codes, delta, memory)
    return motor, table
