"""Where the table of the twin rests at the start, under its loads."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from hil.compiled.source_digest import source_digest
from hil.twin.mechanism import Moment
from hil.twin.stepping import kernel, layout, stages
from hil.twin.stepping.contact import COMPILE

_transmission, _screw, _table_force = stages.transmission, stages.screw, stages.table_force
_along = kernel.along
HALVINGS = 80  # in which the deflection of the transmission is found, from
STROKE = 10.0  # so much of it [motor units]: more than any play


def _build_settle(digest: str) -> Any:
    @njit(cache=True, nogil=True, **COMPILE)
    def settle(constants, modes, values, codes, delta, memory):  # type: ignore[no-untyped-def]
        """Put the table to where it rests under what acts on it and on the transmission at the start, the motor held.

        Quasi-static, in the elastic modes: delta_i = g_i / w_i^2, w^2 = (1 - a11) / b1 of the exact discretisation. The
        deflection of the transmission is found by bisection: the torque that it carries grows with it. What is late or
        hysteretic has not begun.
        """
        assert digest
        if not (codes[layout.ON_TRANSMISSION] or codes[layout.ON_TABLE_FORCE]):
            return
        at_motor, at_table, at_spring = modes[layout.SHAPE_MOTOR], modes[layout.SHAPE_TABLE], modes[layout.SHAPE_SPRING]
        at_screw = modes[layout.SHAPE_SCREW]
        ratio = constants[layout.RATIO]
        angle = _along(at_motor, delta[0]) * constants[layout.ANGLE_PER_UNIT]
        at = Moment(
            0.0,
            0.0,
            constants[layout.PERIOD],
            0.0,
            angle,
            0.0,
            _along(at_table, delta[0]) * ratio,
            ratio,
            constants[layout.VISCOUS_SPEED],
        )
        push = 0.0
        if codes[layout.ON_TABLE_FORCE]:
            push = _table_force(0.0, at, values, codes, memory) * ratio
        stiffer = 0.0
        if codes[layout.ON_SCREW]:
            stiffer = constants[layout.SCREW] * (_screw(1.0, at, values, codes, memory) - 1.0)
        apart = constants[layout.SCREW_APART] > 0.0
        soft = np.zeros(at_motor.size)  # 1 / w^2 of each elastic mode
        spring_push = spring_spring = spring_screw = screw_push = screw_screw = 0.0
        for i in range(1, at_motor.size):
            soft[i] = modes[layout.COARSE + 4, i] / (1.0 - modes[layout.COARSE, i])
            spring_push += at_spring[i] * soft[i] * (at_table[i] - at_motor[i]) * push
            spring_spring += at_spring[i] * soft[i] * at_spring[i]
            spring_screw += at_spring[i] * soft[i] * at_screw[i]
            screw_push += at_screw[i] * soft[i] * (at_table[i] - at_motor[i]) * push
            screw_screw += at_screw[i] * soft[i] * at_screw[i]
        bent = effective = spring = screw = low = high = 0.0
        for trial in range(HALVINGS):
            effective = _transmission(bent, at, values, codes, memory) if codes[layout.ON_TRANSMISSION] else bent
            spring = -constants[layout.SPRING] * (effective - bent)
            if apart:
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
        memory[layout.OWN, layout.SPRING_EXTRA] = effective - bent

    return settle


settle = _build_settle(source_digest())
