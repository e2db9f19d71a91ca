"""Static equilibrium of the table at the start, under its loads."""

import numpy as np
from numba import njit

from hil.twin.stepping import stages
from hil.twin.stepping.contact import COMPILE
from hil.twin.stepping.records import shapes_of, step_of
from hil.twin.stepping.transmission import along, moment

_transmission, _screw, _table_force, _Effects = stages.transmission, stages.screw, stages.table_force, stages.Effects
HALVINGS = 80  # in which the deflection of the transmission is found, from
STROKE = 10.0  # so much of it [motor units]: more than any play


@njit(cache=True, nogil=True, **COMPILE)
def settle(constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
    """Put the table to its rest under the loads, `memory.push` [N] and the transmission, with the motor held.

    Quasi-static, in the elastic modes: delta_i = g_i / w_i^2, w^2 = (1 - a11) / b1 of the exact discretisation. The
    deflection of the transmission is found by bisection: the torque that it carries grows with it. Late and
    hysteretic effects have not begun.
    """
    c, own, on, shapes, step = constants[0], memory[0], codes[0], shapes_of(modes), step_of(modes, False)
    own.carried = along(shapes.motor, delta[0])
    if not (on.transmission or on.table_force or own.push != 0.0):
        return
    effects = _Effects(values, on, own.mechanisms)
    at_motor, at_table, at_spring, at_screw = shapes.motor, shapes.table, shapes.spring, shapes.screw
    at = moment(c, 0.0, 0.0, 0.0, along(at_motor, delta[0]), 0.0, along(at_table, delta[0]) * c.ratio)
    push = _table_force(own.push, at, effects) * c.ratio
    stiffer = c.screw * (_screw(1.0, at, effects) - 1.0)
    soft = np.zeros(at_motor.size)  # 1 / w^2 of each elastic mode
    spring_push = spring_spring = spring_screw = screw_push = screw_screw = 0.0
    for i in range(1, at_motor.size):
        soft[i] = step.b1[i] / (1.0 - step.a11[i])
        spring_push += at_spring[i] * soft[i] * (at_table[i] - at_motor[i]) * push
        spring_spring += at_spring[i] * soft[i] * at_spring[i]
        spring_screw += at_spring[i] * soft[i] * at_screw[i]
        screw_push += at_screw[i] * soft[i] * (at_table[i] - at_motor[i]) * push
        screw_screw += at_screw[i] * soft[i] * at_screw[i]
    bent = effective = spring = screw = low = high = 0.0
    for trial in range(HALVINGS):
        effective = _transmission(bent, at, effects)
        spring = -c.spring * (effective - bent)
        if c.screw_apart > 0:
            screw = -stiffer * (screw_push + spring_screw * spring) / (1.0 + stiffer * screw_screw)
        else:
            screw = -stiffer * effective
        missing = spring_push + spring_spring * spring + spring_screw * screw - bent
        if abs(missing) <= 1e-15:
            break
        if trial == 0:  # from no deflection on towards the load
            low, high = min(4.0 * missing - STROKE, 0.0), max(4.0 * missing + STROKE, 0.0)
        if missing > 0.0:
            low = bent
        else:
            high = bent
        bent = 0.5 * (low + high)
    moved = 0.0
    for i in range(1, at_motor.size):
        shift = soft[i] * (push * (at_table[i] - at_motor[i]) + spring * at_spring[i] + screw * at_screw[i])
        delta[0, i] += shift
        moved += at_motor[i] * shift
    delta[0, 0] -= moved / at_motor[0]
    own.spring_extra = effective - bent
